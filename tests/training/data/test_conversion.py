"""False-alarm rates: 1e-4 each, at fixed seeds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.data.conversion import draw_charges, drop_lowest, state_rate, take_rate, unweighted
from deepmuon_training.sample import Sample

MUONS = Muons.of([1.0, 1e-3, 0.5e-3, 300.0], [0.0] * 4, [0.0] * 4, [-1.0] * 4, [0] * 4)


def made(muons: Muons) -> Sample:
    return Sample(muons, depth_m=0.0, source="the tests", provenance=("by hand",))


@pytest.fixture
def sample() -> Sample:
    with pytest.warns(UserWarning, match="below 1 MeV"):
        return drop_lowest(made(MUONS), "GeV")


def test_muons_below_1_mev_are_dropped_and_counted(sample):
    np.testing.assert_array_equal(sample.muons.kinetic_energy, np.float32([1.0, 1e-3, 300.0]))
    assert sample.provenance == ("by hand", "1 of 4 muons below 1 MeV dropped")


def test_a_sample_without_such_muons_stays_as_it_is():
    whole = made(MUONS[:2])
    assert drop_lowest(whole, "MeV") is whole


def test_a_known_rate_loses_what_is_dropped():
    known = replace(made(MUONS), rate=8.0, rate_uncertainty=0.4)
    with pytest.warns(UserWarning, match="1 of 4 muons"):
        dropped = drop_lowest(known, "MeV")
    assert (dropped.rate, dropped.rate_uncertainty) == (6.0, pytest.approx(0.3))


@pytest.mark.parametrize(
    ("unit", "question"),
    [("MeV", "are the energies in GeV, and not in MeV?"), ("GeV", "are the energies in TeV, and not in GeV?")],
)
def test_many_that_are_dropped_are_a_warning_that_names_the_likely_cause(unit, question):
    many = made(MUONS[np.repeat([0, 2], [980, 20])])
    with pytest.warns(UserWarning, match="20 of 1,000 muons are below 1 MeV") as warned:
        drop_lowest(many, unit)
    assert str(warned[0].message).endswith(question)
    drop_lowest(made(MUONS[np.repeat([0, 2], [990, 10])]), unit)  # and 1 % are none


def test_muons_of_which_none_is_left_are_refused():
    with pytest.raises(RefusedError, match="no muon of at least 1 MeV among 1: are the energies in GeV"):
        drop_lowest(made(MUONS[2:3]), "MeV")


def test_weights_become_numbers_of_muons():
    n = 200_000
    random = np.random.default_rng(1)
    energy = random.uniform(1, 2, n)
    weights = 3.0 * (energy - 1)
    kept, told = unweighted(Muons.of(energy, [0] * n, [0] * n, [-1] * n, [13] * n), weights, seed=1)
    share = np.mean(weights) / np.max(weights)
    assert abs(len(kept) - n * share) < 3.9 * np.sqrt(n * share * (1 - share))
    above = np.sum(kept.kinetic_energy > 1.5)  # of density 2 (E - 1): three quarters
    assert abs(above - 0.75 * len(kept)) < 3.9 * np.sqrt(len(kept) * 0.75 * 0.25)
    effective = weights.sum() ** 2 / (weights**2).sum()
    assert told == (
        f"unweighted by accept-reject, seed 1: {len(kept):,} of 200,000 muons kept, effective size {effective:,.0f}"
    )


def test_weights_that_are_all_the_same_change_nothing():
    assert unweighted(MUONS, np.full(4, 2.5), seed=1) == (MUONS, "the weights are all the same")


@pytest.mark.parametrize(
    ("weights", "reason"),
    [
        (np.repeat([1.0, 0.0], [99, 901]), "are worth 99 of one weight, and 100 are the fewest"),
        (np.zeros(1000), "are worth 0 of one weight"),
        (np.repeat([1.0, 10.0], [900, 1]), "one muon weighs 10 times the mean: of 901 only 91 would be kept"),
    ],
)
def test_weights_that_leave_too_few_muons_are_refused(weights, reason):
    with pytest.raises(RefusedError, match=reason):
        unweighted(MUONS[np.zeros(len(weights), int)], weights, seed=1)


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
    many = made(MUONS[np.zeros(100_000, int)])
    charged = draw_charges(many, 1.5, seed=1)
    assert charged.provenance[-1] == "charge drawn: 1.5 mu+ for each mu-, seed 1"
    assert abs(np.sum(charged.muons.charge > 0) - 60_000) < 3.9 * np.sqrt(100_000 * 0.6 * 0.4)
    np.testing.assert_array_equal(charged.muons.pdg_id, draw_charges(many, 1.5, seed=1).muons.pdg_id)
    assert np.any(charged.muons.pdg_id != draw_charges(many, 1.5, seed=2).muons.pdg_id)
