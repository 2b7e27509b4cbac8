from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.scores.kolmogorov_smirnov import kolmogorov_smirnov

samples = st.lists(st.integers(-5, 5) | st.floats(-5, 5, width=32), min_size=2, max_size=40)


@given(samples, samples)
def test_the_distance_is_scipys_ties_included(a, b):
    expected = stats.ks_2samp(a, b, method="asymp").statistic
    assert kolmogorov_smirnov(np.array(a, np.float32), np.array(b, np.float32)).distance == pytest.approx(expected)


def test_the_stated_noise_is_that_of_alike_samples():
    # 400 pairs: the mean is known to 1.5 %, 1 % of them is 4 +- 2; 4 sigma each, a false alarm in 1,000
    random = np.random.default_rng(1)
    pairs = [kolmogorov_smirnov(random.random(3000), random.random(1000)) for _ in range(400)]
    assert np.mean([pair.distance for pair in pairs]) == pytest.approx(pairs[0].mean_noise, rel=0.06)
    assert sum(pair.excess > 0 for pair in pairs) <= 12


def test_half_a_percent_of_energy_is_an_excess():
    # 1/n + 1/m is that of 20,000,000 against 2,000,000; a clean pair has an excess once in a hundred
    truth, clean = (sea_level_muons(4_000_000, seed=seed).kinetic_energy for seed in (1, 2))
    assert kolmogorov_smirnov(clean, truth).excess < 0
    assert kolmogorov_smirnov(clean * np.float32(1.005), truth).excess > 0
