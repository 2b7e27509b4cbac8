from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from deepmuon_runtime.muons import Muons
from deepmuon_training.underground.unweighted import CHUNK, REPEATED, Unweighting

CHUNKS = 8


@pytest.fixture(scope="module")
def unweighting(under_water, kilometre) -> Unweighting:
    return Unweighting.of(under_water(1000), kilometre)


@pytest.fixture(scope="module")
def muons(unweighting, workers) -> Muons:
    return Muons.concatenate([unweighting.chunk(workers, 1, number) for number in range(CHUNKS)])


def test_muons_of_equal_weight_have_the_rate_of_the_integral(unweighting, muons, kilometre):
    rate = len(muons) * unweighting.ceiling / (CHUNKS * CHUNK)
    # four standard deviations: one false alarm in fifteen thousand
    assert abs(rate - kilometre.value) < 4 * np.hypot(kilometre.error, rate / np.sqrt(len(muons)))


@pytest.mark.parametrize("column", ["energy", "cos_zenith"])
def test_they_are_distributed_as_the_weighted_trials(muons, kilometre, column):
    trials, found = getattr(kilometre.trials, column), muons.cos_zenith
    if column == "energy":
        found = muons.kinetic_energy
    edges = np.quantile(trials, np.linspace(0, 1, 21))
    edges[[0, -1]] = 0, np.inf
    counts = np.histogram(found, edges)[0] / len(muons)
    expected, squares = (np.histogram(trials, edges, weights=kilometre.weights**power)[0] for power in (1, 2))
    total = expected.sum()
    variance = expected / total / len(muons) + squares / total**2  # Poisson's: more than these trials have
    score = np.sum((counts - expected / total) ** 2 / variance)
    assert score < chi2.isf(1e-4, 20)


def test_their_charges_are_those_of_the_flux_at_the_energies_they_came_with(muons, kilometre):
    share = np.mean(muons.charge > 0)
    assert abs(share - kilometre.positive) < 3.9 * 0.5 / np.sqrt(len(muons))  # one false alarm in ten thousand


def test_few_repeat_another_and_those_differ_in_azimuth(unweighting, muons):
    same = np.diff(muons.kinetic_energy) == 0
    assert unweighting.repeated <= REPEATED
    expected = unweighting.repeated * len(muons)
    assert 0 < same.sum() < 3 * expected  # the mean of those that have one copy is twice that at most
    assert np.all(np.diff(muons.u)[same] != 0)


def test_they_come_down_from_all_sides(muons):
    assert np.all(muons.w < 0)
    for component in (muons.u, muons.v):
        assert abs(component.mean()) < 3.9 * component.std() / np.sqrt(len(muons))  # one false alarm in ten thousand
