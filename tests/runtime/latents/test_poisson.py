from __future__ import annotations

import math

import numpy as np
import pytest

from deepmuon_runtime.latents.poisson import poisson

SEEDS = 5_000
STREAM = 2**63 + 1


@pytest.mark.parametrize("mean", [0.01, 1.0, 9.99, 10.01, 40.0, 1000.0])
def test_numbers_have_the_poisson_probabilities(mean):
    """Chi2 over cells that expect 10 and more, at 5 standard deviations: 1e-5 false alarms for each mean."""
    numbers = np.array([poisson(mean, seed, STREAM) for seed in range(SEEDS)])
    largest = int(mean + 10 * math.sqrt(mean) + 20)
    expected = np.array([SEEDS * math.exp(k * math.log(mean) - mean - math.lgamma(k + 1)) for k in range(largest)])
    found = np.bincount(numbers, minlength=largest)
    assert len(found) == largest
    common = expected >= 10
    expected = np.append(expected[common], expected[~common].sum())
    found = np.append(found[common], found[~common].sum())
    cells = expected > 1
    chi2 = ((found - expected)[cells] ** 2 / expected[cells]).sum()
    freedom = cells.sum() - 1
    assert chi2 < freedom + 5 * math.sqrt(2 * freedom) + 5


@pytest.mark.parametrize("mean", [1e6, 1e9, 1e12])
def test_large_numbers_have_the_poisson_mean_and_variance(mean):
    """At 5 standard deviations: 1e-6 false alarms."""
    deviations = np.array([poisson(mean, seed, STREAM) - mean for seed in range(SEEDS)]) / math.sqrt(mean)
    assert abs(deviations.mean()) < 5 / math.sqrt(SEEDS)
    assert abs(deviations.var() - 1) < 5 * math.sqrt(2 / SEEDS)


def test_a_seed_always_gives_the_same_number():
    assert [poisson(mean, 1, 0) for mean in (0.5, 5.0, 500.0, 5e9)] == [0, 4, 503, 5000010730]
