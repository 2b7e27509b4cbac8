"""False-alarm rates: 1e-4 each, at fixed seeds."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.stats import chisquare, kstest

from deepmuon_training.fluxes.ecomug import intensity, plane_rate, sea_level_muons
from deepmuon_training.fluxes.flux import MUON_MASS


def momentum(kinetic_energy):
    return np.sqrt(kinetic_energy * (kinetic_energy + 2 * MUON_MASS))


def integral(low, high):
    """Rate per m2 of a horizontal plane between two momenta, by two-dimensional quadrature."""
    rate, _ = dblquad(
        lambda log_p, c: 2 * np.pi * intensity(np.exp(log_p), c) * c * np.exp(log_p), 0, 1, np.log(low), np.log(high)
    )
    return rate


def test_the_rate_is_the_integral_of_the_intensity_over_the_hemisphere():
    assert plane_rate(1.0, 100.0) == pytest.approx(integral(momentum(1.0), momentum(100.0)), rel=1e-5)


def test_energies_follow_the_integrated_intensity():
    muons = sea_level_muons(200_000, seed=1)
    edges = np.geomspace(0.5, 200, 12)
    found = np.histogram(muons.kinetic_energy, edges)[0]
    expected = np.array([plane_rate(low, high) for low, high in pairwise(edges)])
    assert chisquare(found, expected / expected.sum() * found.sum()).pvalue > 1e-4


def test_zenith_angles_follow_the_intensity_at_their_energy():
    muons = sea_level_muons(400_000, seed=2)
    near = np.abs(muons.kinetic_energy - 5.0) < 0.1
    power = 2.856 - 0.655 * np.log(momentum(5.0))
    assert kstest(muons.cos_zenith[near], lambda c: c ** (power + 2)).pvalue > 1e-4


def test_directions_are_downward_unit_vectors():
    muons = sea_level_muons(10_000, seed=3)
    assert np.all(muons.w < 0)
    np.testing.assert_allclose(muons.u**2 + muons.v**2 + muons.w**2, 1, atol=1e-6)


def test_the_charge_ratio_is_the_one_asked_for():
    positive = np.sum(sea_level_muons(100_000, seed=4, charge_ratio=1.5).charge > 0)
    assert abs(positive - 60_000) < 3.9 * np.sqrt(100_000 * 0.6 * 0.4)


def test_a_seed_gives_the_same_muons_again():
    first, second = sea_level_muons(100, seed=5), sea_level_muons(100, seed=5)
    np.testing.assert_array_equal(first.kinetic_energy, second.kinetic_energy)
    np.testing.assert_array_equal(first.u, second.u)
