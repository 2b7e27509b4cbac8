from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit

from deepmuon_runtime.physical import LOWEST_ENERGY
from deepmuon_training.generators.quantile.maps import inclination, inclination_slope
from deepmuon_training.learning.splines import Axis, Surface

LEVEL = st.floats(-10, 15)


def test_the_energy_rises_with_its_level_through_both_tails(quantile):
    assert np.all(np.diff(quantile.log_energy(np.linspace(-34, 34, 20_001))) > 0)


def test_the_energies_of_the_outermost_levels_are_the_ends_of_the_spectrum(quantile):
    assert np.exp(quantile.log_energy(np.array([-60.0, 60.0]))) == pytest.approx([LOWEST_ENERGY, 1e5], rel=1e-6)


@given(LEVEL)
def test_the_level_of_an_energy_is_the_one_that_it_was_made_of(quantile, t):
    (found,) = quantile.energy_logit(quantile.log_energy(np.array([t])))
    assert found == pytest.approx(t, abs=1e-9)


@pytest.mark.parametrize("exponent", [1.5, 3.0])
def test_a_density_that_is_a_power_law_has_the_quantiles_of_one(quantile, exponent):
    axis = Axis(0.0, 1.0, 4)
    line = -exponent * (-0.25 + 0.25 * np.arange(7))  # ln density = -exponent ln E: B-splines repeat a straight line
    pareto = replace(quantile, energy=Surface(axis, Axis(0.0, 1.0, 0), line[:, None]), energy_range=(1.0, 1e30))
    t = np.linspace(-15, 30, 46)
    np.testing.assert_allclose(pareto.log_energy(t), -np.log(expit(-t)) / exponent, rtol=1e-3, atol=2e-6)


@given(t=st.floats(-40, 40))
def test_cos_zenith_rises_with_its_level_at_any_energy(quantile, t):
    logit = quantile.cos_zenith_logit(np.linspace(-18, 18, 500), np.array([t]))
    assert logit.shape == (1, 500)
    assert np.all(np.diff(logit) > 0)


def test_muons_are_even_around_the_vertical(quantile):
    """1 - cos zenith goes there with the distance of the level from its end."""
    level = np.array([12.0, 14, 16, 17.5])
    slope = np.diff(quantile.cos_zenith_logit(level, np.array([-6.0, 0, 6]))) / np.diff(level)
    np.testing.assert_allclose(slope, 1, atol=1e-3)


def test_near_the_horizon_cos_zenith_is_a_power_of_its_level(quantile):
    cosines = quantile.cos_zenith_logit(np.array([-17.0, -16, -15]), np.zeros(1))[0]
    assert cosines[2] < np.log(3e-2)
    np.testing.assert_allclose(*np.diff(cosines), rtol=0.03)


def test_angles_and_charges_beyond_the_ends_of_the_sample_are_those_of_its_ends(quantile):
    levels = np.linspace(-5, 5, 11)
    for end, farther in ((quantile.zenith.x.low, -5), (quantile.zenith.x.high, 5)):
        t = np.array([end, end + farther])
        np.testing.assert_array_equal(*quantile.cos_zenith_logit(levels, t))
        np.testing.assert_array_equal(*quantile.charge_logit(t, np.zeros(2)))


@given(st.floats(-13, 25))
def test_the_slope_of_the_inclination_is_that_of_its_values(logit):
    step = 1e-4
    low, high = inclination(np.array([logit - step, logit + step]))
    assert inclination_slope(np.array(logit)) == pytest.approx((low - high) / (2 * step), rel=1e-5, abs=1e-11)
