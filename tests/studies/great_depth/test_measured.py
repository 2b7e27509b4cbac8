from __future__ import annotations

import numpy as np
import pytest

from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.fluxes.plane import plane_rate
from studies.great_depth.engines import above, distance
from studies.great_depth.measured import FITS, read_intensities, read_totals


def test_the_fits_have_the_values_of_their_papers_formulas():
    by_name = {fit.name: fit for fit in FITS}
    for name, value in (("Menon", 2.414e-4), ("Mei and Hime", 2.494e-4)):  # per m2, s and sr
        found, error = by_name[name](np.array([3.0]))
        assert found[0] == pytest.approx(value, rel=1e-3)
        assert 0.05 < error[0] / found[0] < 0.3


def test_measured_values_have_errors_and_sources_and_fall_with_depth():
    for one in (*read_intensities(), *read_totals()):
        assert 0 < one.error < 0.2 * one.value
        assert one.source
    depths = sorted(read_intensities(), key=lambda one: one.depth_kmwe)
    assert depths[0].value > 100 * depths[-1].value


def test_muons_that_may_come_so_deep_have_the_rate_of_the_flux():
    sample = above(10, 100_000)
    assert sample.muons.kinetic_energy.min() >= 1.7
    all_of_it = plane_rate(MEASURED, 1.7, 1e5)
    assert sample.rate == pytest.approx(all_of_it * len(sample) / 100_000)
    assert np.all(sample.muons.kinetic_energy * sample.muons.cos_zenith >= 1.7 * (1 - 1e-6))


def test_weighted_trials_of_a_distribution_are_near_its_muons():
    random = np.random.default_rng(1)
    muons, trials = random.exponential(size=20_000), 5 * random.random(20_000)
    weights = np.exp(-trials)
    chance = 1.95 * np.sqrt(1 / 20_000 + (weights @ weights) / weights.sum() ** 2)  # one false alarm in a thousand
    assert distance(muons[muons < 5], trials, weights) < chance
    assert distance(2 * muons, trials, weights) > 5 * chance
