from __future__ import annotations

import numpy as np
import pytest

from deepmuon_runtime.muons import Muons
from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.scores.azimuth import compare_azimuth


def modulated(n: int, amplitude: float, order: int, seed: int) -> Muons:
    """Muons with density 1 + amplitude cos(order azimuth), by acceptance."""
    muons = sea_level_muons(n, seed=seed)
    density = 1 + amplitude * np.cos(order * np.arctan2(muons.v, muons.u))
    return muons[np.random.default_rng([seed, 1]).random(n) * (1 + amplitude) < density]


@pytest.mark.parametrize("amplitude", [0.0, 0.8])
def test_alike_samples_agree_whatever_their_azimuth(amplitude):
    # 100 pairs: mean and spread of sigma within 4 of their errors 0.1 and 0.07, a false alarm in 8,000
    sigma = [
        compare_azimuth(modulated(20_000, amplitude, 1, seed), modulated(40_000, amplitude, 1, 1000 + seed))
        for seed in range(100)
    ]
    sigma = [score.chi_square.sigma for score in sigma]
    assert abs(np.mean(sigma)) < 0.4
    assert abs(np.std(sigma) - 1) < 0.28


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_planted_harmonic_is_found_with_its_amplitude(order):
    score = compare_azimuth(modulated(1_000_000, 0.02, order, 1), sea_level_muons(1_000_000, seed=2))
    assert score.chi_square.sigma > 5
    for harmonics in score.harmonics.values():
        for harmonic in harmonics:
            planted = 0.02 if harmonic.order == order else 0.0
            assert abs(harmonic.difference - planted) < 4 * harmonic.noise  # 12 numbers: below 1e-5


def test_vertical_muons_have_no_azimuth():
    muons = sea_level_muons(10_000, seed=1)
    zero = np.zeros_like(muons.u)
    score = compare_azimuth(Muons(muons.kinetic_energy, zero, zero, zero - 1, muons.pdg_id), muons)
    assert score.harmonics == {}
    assert score.chi_square.ndf == 0
