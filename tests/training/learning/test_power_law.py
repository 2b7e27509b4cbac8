from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from deepmuon_training.learning.power_law import TAIL_MUONS, PowerLawTails, fit_power_law

LEVELS = st.floats(0, 1)
EXPONENTS = st.floats(-3, 5).filter(lambda g: abs(g) > 1e-3)


def truncated_pareto(exponent: float, low: float, high: float, n: int, seed: int) -> np.ndarray:
    """Draw x with a survival function proportional to x^-exponent - high^-exponent."""
    survival = 1 - np.random.default_rng(seed).random(n)
    ends = np.array([low, high]) ** -exponent
    return (ends[1] + survival * (ends[0] - ends[1])) ** (-1 / exponent)


def standard_error(exponent: float, span: float, n: int) -> float:
    """Of the most likely exponent: the Fisher information of x over exp(span) is a variance of log x."""
    growth = np.exp(exponent * span)
    return 1 / np.sqrt(n * (1 / exponent**2 - span**2 * growth / (growth - 1) ** 2))


@pytest.mark.parametrize("exponent", [-1.0, 0.3, 1.8, 2.6, 4.0])
@pytest.mark.parametrize("span", [1.4, 6.0])
def test_the_exponent_is_found_within_its_error(exponent, span):
    values = truncated_pareto(exponent, 1.0, np.exp(span), 20_000, seed=1)
    found = fit_power_law(values, 1.0, float(np.exp(span)))
    assert abs(found - exponent) < 4 * standard_error(exponent, span, 20_000)  # ten times: false alarms 6e-4


def test_a_density_that_goes_as_1_over_x_has_the_exponent_0():
    found = fit_power_law(np.exp(np.random.default_rng(1).random(20_000)), 1.0, np.e)
    assert abs(found) < 4 * np.sqrt(12 / 20_000)


@pytest.fixture(scope="module")
def spectrum():
    """F(E) as E^1.5 below 1 GeV, the survival function as E^-2.5 above, half of the muons each, 1 MeV to 100 TeV."""
    low = 1 / truncated_pareto(1.5, 1.0, 1e3, 100_000, seed=1)
    high = truncated_pareto(2.5, 1.0, 1e5, 100_000, seed=2)
    return np.random.default_rng(3).permutation(np.concatenate([low, high]))


@pytest.fixture(scope="module")
def tails(spectrum):
    return PowerLawTails.fit(spectrum, energy_min=1e-3, energy_max=1e5)


def test_both_tails_are_found_within_their_errors(tails):
    assert tails.level == TAIL_MUONS / 200_000
    for found, planted, span in (
        (tails.low_exponent, 1.5, np.log(tails.low / 1e-3)),
        (tails.high_exponent, 2.5, np.log(1e5 / tails.high)),
    ):
        assert abs(found - planted) < 4 * standard_error(planted, span, TAIL_MUONS)


def test_the_tails_begin_at_their_level(spectrum, tails):
    assert np.sum(spectrum < tails.low) == TAIL_MUONS
    assert np.sum(spectrum > tails.high) == TAIL_MUONS


def planted(low_exponent: float, high_exponent: float) -> PowerLawTails:
    return PowerLawTails(0.01, 0.05, 100.0, low_exponent, high_exponent, 1e-3, 1e5)


@given(low_exponent=EXPONENTS, high_exponent=EXPONENTS)
def test_the_spectrum_has_no_gap_at_the_joints_and_ends_at_its_ends(low_exponent, high_exponent):
    tails = planted(low_exponent, high_exponent)
    levels = np.array([0.01, 0.0])
    np.testing.assert_allclose(tails.lowest(levels), [0.05, 1e-3], rtol=1e-9)
    np.testing.assert_allclose(tails.highest(levels), [100.0, 1e5], rtol=1e-9)


@given(low_exponent=EXPONENTS, high_exponent=EXPONENTS, level=LEVELS)
def test_every_energy_is_within_the_ends(low_exponent, high_exponent, level):
    tails = planted(low_exponent, high_exponent)
    level = np.array([0.01 * level])
    assert 1e-3 * (1 - 1e-9) <= tails.lowest(level) <= 0.05 * (1 + 1e-9)
    assert 100.0 * (1 - 1e-9) <= tails.highest(level) <= 1e5 * (1 + 1e-9)


@given(low_exponent=EXPONENTS, high_exponent=EXPONENTS)
def test_a_smaller_tail_probability_lies_farther_out(low_exponent, high_exponent):
    tails, levels = planted(low_exponent, high_exponent), np.linspace(0.01, 0, 100)
    assert np.all(np.diff(tails.lowest(levels)) < 0)
    assert np.all(np.diff(tails.highest(levels)) > 0)


@pytest.mark.parametrize("exponent", [0.5, 1.8, 2.6])
def test_muons_do_not_pile_up_at_the_ends(exponent):
    # A plain power law cut off at the end would leave a jump there, of (high / end)^exponent of the tail.
    tails = PowerLawTails(0.01, 0.05, 100.0, exponent, exponent, 1e-3, 1e3)
    level = 0.01 * (1 - np.random.default_rng(1).random(100_000))
    for energies, start, end in (
        (tails.highest(level), 100.0, 1e3),
        (1 / tails.lowest(level), 20.0, 1e3),
    ):
        ends = np.array([start, end]) ** -exponent
        assert kstest(energies, lambda x, e=ends: (e[0] - x**-exponent) / (e[0] - e[1])).pvalue > 1e-4
        expected = 100_000 * ((0.9 * end) ** -exponent - ends[1]) / (ends[0] - ends[1])
        assert abs(np.sum(energies > 0.9 * end) - expected) < 4 * np.sqrt(expected)  # false alarms: 6e-5
        assert np.sum(energies >= end) <= 1


def test_the_tails_of_a_small_sample_take_no_more_than_a_sixtieth_each(spectrum):
    # A thousand of 6,000 sea-level muons reach down to 7 GeV, where no power law holds.
    tails = PowerLawTails.fit(spectrum[:6000], energy_min=1e-3, energy_max=1e5)
    assert tails.level == 100 / 6000
    assert tails.high == np.sort(spectrum[:6000])[-101]
    assert abs(tails.high_exponent - 2.5) < 4 * 2.5 / np.sqrt(100)  # false alarms 6e-5
