"""False-alarm rates: 1e-4 each, at fixed seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.data.conversion import draw_charges, sample_of, state_rate, take_rate
from deepmuon_training.sample import Sample

MUONS = Muons.of([1.0, 1e-3, 0.5e-3, 300.0], [0.0] * 4, [0.0] * 4, [-1.0] * 4, [0] * 4)


@pytest.fixture
def sample() -> Sample:
    return sample_of(MUONS, "by hand", source="the tests")


def test_muons_below_1_mev_are_dropped_and_counted(sample):
    np.testing.assert_array_equal(sample.muons.kinetic_energy, np.float32([1.0, 1e-3, 300.0]))
    assert sample.provenance == ("by hand: 4 muons, 1 below 1 MeV dropped",)
    assert (sample.depth_m, sample.medium, sample.source) == (0.0, "G4_WATER", "the tests")
    assert sample.rate is sample.rate_uncertainty is sample.smoothed is None


def test_muons_of_which_none_is_left_are_refused():
    with pytest.raises(RefusedError, match="by hand: there is no muon of at least 1 MeV among 1"):
        sample_of(MUONS[2:3], "by hand", source="the tests")


def test_a_stated_rate_is_taken_as_it_is(sample):
    stated = state_rate(sample, 110.5, 0.4)
    assert (stated.rate, stated.rate_uncertainty) == (110.5, 0.4)
    assert stated.provenance[-1] == "rate stated: 110.5 +- 0.4 per m2 and s"
    assert state_rate(sample, 110.5).rate_uncertainty is None


def test_a_live_time_gives_the_rate_and_what_counting_leaves_open(sample):
    counted = take_rate(sample, live_time=2.0, area=0.5)
    assert counted.rate == 3.0
    assert counted.rate_uncertainty == pytest.approx(math.sqrt(3))
    assert take_rate(sample, 2.0, 0.5, count_variance=4.0).rate_uncertainty == pytest.approx(2 * math.sqrt(3))
    assert counted.provenance[-1] == "rate from 3 muons in 2 s on 0.5 m2"


@pytest.mark.parametrize(("ratio", "pdg_id", "name"), [(0.0, 13, "mu-"), (math.inf, -13, "mu+")])
def test_a_stated_charge_is_that_of_all(sample, ratio, pdg_id, name):
    charged = draw_charges(sample, ratio, seed=1)
    np.testing.assert_array_equal(charged.muons.pdg_id, [pdg_id] * 3)
    assert charged.provenance[-1] == f"charge stated: all {name}"


def test_drawn_charges_have_the_ratio_and_a_seed(sample):
    many = sample_of(MUONS[np.zeros(100_000, int)], "by hand", source="the tests")
    charged = draw_charges(many, 1.5, seed=1)
    assert charged.provenance[-1] == "charge drawn: 1.5 mu+ for each mu-, seed 1"
    assert abs(np.sum(charged.muons.charge > 0) - 60_000) < 3.9 * np.sqrt(100_000 * 0.6 * 0.4)
    np.testing.assert_array_equal(charged.muons.pdg_id, draw_charges(many, 1.5, seed=1).muons.pdg_id)
    assert np.any(charged.muons.pdg_id != draw_charges(many, 1.5, seed=2).muons.pdg_id)
