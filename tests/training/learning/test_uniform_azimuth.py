from __future__ import annotations

import numpy as np
import pytest

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.learning.uniform_azimuth import check_uniform_azimuth, measure_uniformity


def muons(n: int, seed: int, amplitude: float = 0.0, order: int = 1, low: float = 0.1, high: float = 100.0) -> Muons:
    """Muons of 60 degrees zenith whose azimuth has the density 1 + amplitude cos(order azimuth)."""
    random = np.random.default_rng([seed, n])
    azimuth = random.uniform(-np.pi, np.pi, 4 * n)
    azimuth = azimuth[random.uniform(0, 1 + amplitude, 4 * n) < 1 + amplitude * np.cos(order * azimuth)][:n]
    energy = 10 ** random.uniform(np.log10(low), np.log10(high), n)
    sine = np.sqrt(0.75)
    columns = energy, sine * np.cos(azimuth), sine * np.sin(azimuth), np.full(n, -0.5)
    return Muons(*(c.astype(np.float32) for c in columns), np.full(n, 13, np.int8))


def test_a_uniform_azimuth_has_a_chi_square_of_its_degrees_of_freedom():
    found = [measure_uniformity(muons(6000, seed)) for seed in range(200)]
    assert {score.ndf for score in found} == {24}
    mean, variance = np.mean([s.chi2 for s in found]), np.var([s.chi2 for s in found])
    assert abs(mean - 24) < 4 * np.sqrt(48 / 200)  # false alarm: 6e-5
    assert abs(variance / 48 - 1) < 4 * np.sqrt((2 + 12 / 24) / 200)  # kurtosis of chi2: 12 / ndf


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("energies", [(0.01, 1.0), (1.0, 10.0), (10.0, 1000.0)])
def test_a_harmonic_in_any_energy_range_is_found(order, energies):
    with pytest.raises(RefusedError, match="the azimuth is not uniform"):
        check_uniform_azimuth(muons(20_000, 1, amplitude=0.1, order=order, low=energies[0], high=energies[1]))


def test_few_and_vertical_muons_say_nothing():
    few = muons(900, 1, amplitude=1.0)
    check_uniform_azimuth(few)
    zeros = np.zeros(5000, np.float32)
    check_uniform_azimuth(Muons(zeros + 3, zeros, zeros, zeros - 1, np.full(5000, 13, np.int8)))
