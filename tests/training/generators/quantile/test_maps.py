from __future__ import annotations

import copy

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime.physical import LOWEST_ENERGY
from deepmuon_training.learning.power_law import TAIL_MUONS


@pytest.fixture(scope="module")
def generator(quantile):
    return copy.deepcopy(quantile).double().requires_grad_(False)


def energies(generator, logit):
    return generator.transform.energy(generator.pre_tanh(torch.as_tensor(logit, dtype=torch.float64))).numpy()


def edge(generator) -> float:
    return float(np.log(1 / generator.tails.level - 1))


def test_the_energy_rises_with_its_level_through_both_tails(generator):
    found = energies(generator, np.linspace(-34, 34, 20_001))
    assert np.all(np.diff(found) > 0)


@pytest.mark.parametrize("end", [-1, 1])
def test_the_spectrum_has_no_gap_where_the_power_laws_begin(generator, end):
    inside, beyond = energies(generator, end * edge(generator) * np.array([1 - 1e-12, 1 + 1e-12]))
    assert inside == pytest.approx(beyond, rel=1e-8)


def test_the_power_laws_begin_where_the_sample_thins_out(generator, sample):
    ordered = np.sort(sample.muons.kinetic_energy)
    tails = generator.tails
    assert tails.level == TAIL_MUONS / len(sample)
    # its quantiles have errors of 3 % of a tail of 1000, over a slope of 1.4 and 2.6
    assert tails.low == pytest.approx(ordered[TAIL_MUONS], rel=0.05)
    assert tails.high == pytest.approx(ordered[-TAIL_MUONS - 1], rel=0.05)


def test_the_energies_of_the_outermost_levels_are_the_ends_of_the_spectrum(generator):
    assert energies(generator, [-60.0, 60.0]) == pytest.approx([LOWEST_ENERGY, 1e5], rel=1e-6)


@given(energy=st.floats(1e-3, 1e5))
def test_cos_zenith_rises_with_its_level_at_any_energy(generator, energy):
    y = generator.transform.pre_tanh(torch.tensor([energy], dtype=torch.float64))
    logit = generator.cos_zenith_logit(torch.linspace(-18, 18, 500, dtype=torch.float64)[None], y)
    assert logit.shape == (1, 500)
    assert torch.all(logit.diff(dim=1) > 0)


def test_angles_beyond_the_ends_of_the_sample_are_those_of_its_ends(generator):
    levels = torch.linspace(-5, 5, 11, dtype=torch.float64).expand(2, -1)
    for end, farther in ((generator.condition.low, -5), (generator.condition.high, 5)):
        y = torch.tensor([end, end + farther], dtype=torch.float64)
        torch.testing.assert_close(*generator.cos_zenith_logit(levels, y))
