from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit
from scipy.stats import chi2, norm

from deepmuon_runtime.errors import FailedError
from deepmuon_training.learning import splines
from deepmuon_training.learning.splines import Axis, Surface, fit_log_density, fit_logit

CONSTANT = Axis(0.0, 1.0, 0)


def density_of(values: np.ndarray, axis: Axis) -> Surface:
    """The density of values [n] over one variable."""
    counts = np.bincount(axis.bin_of(values), minlength=axis.bins)[:, None].astype(float)
    return fit_log_density((axis, CONSTANT), counts, len(values) * np.diff(axis.edges)[:, None])


def along(surface: Surface, x: np.ndarray) -> np.ndarray:
    return surface(x, np.zeros(1))[:, 0]


@given(
    low=st.floats(-100, 100), width=st.floats(1e-3, 1e3), intervals=st.integers(1, 50), seed=st.integers(0, 2**32 - 1)
)
def test_the_splines_add_up_to_one_and_repeat_a_straight_line_inside_and_outside(low, width, intervals, seed):
    axis = Axis(low, low + width, intervals)
    x = low + width * (3 * np.random.default_rng(seed).random(50) - 1)
    basis = axis.basis(x)
    np.testing.assert_allclose(basis.sum(axis=1), 1, atol=1e-12)
    knots = low + width / intervals * (np.arange(intervals + 3) - 1)
    np.testing.assert_allclose(basis @ knots, x, atol=1e-9 * (abs(low) + width))


def test_the_splines_have_no_corner_at_knots_or_ends():
    axis = Axis(0.0, 1.0, 5)
    for knot in np.linspace(0, 1, 6):
        before, at, after = axis.basis(knot + np.array([-1e-6, 0, 1e-6]))
        np.testing.assert_allclose(after - at, at - before, atol=1e-10)


def test_a_value_at_the_very_end_is_in_the_last_bin():
    axis = Axis(-1.0, 2.0, 7)
    assert axis.bin_of(np.array([-1.0, 2.0, -5.0, 9.0])).tolist() == [0, axis.bins - 1, 0, axis.bins - 1]
    assert len(axis.edges) == axis.bins + 1 == len(axis.middles) + 1


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_density_is_that_of_the_truth_within_its_noise(seed):
    """Chi-square of the fitted density on bins of its own sample and of the truth."""
    n, axis = 200_000, Axis(-5.0, 5.0, 60)
    fitted = density_of(np.random.default_rng(seed).normal(size=n), axis)
    edges = np.linspace(-3.5, 3.5, 71)
    fine = np.linspace(-3.5, 3.5, 70 * 20 + 1)
    cumulative = np.concatenate(
        [[0], np.cumsum(np.exp(along(fitted, (fine[1:] + fine[:-1]) / 2))) * (fine[1] - fine[0])]
    )
    found, expected = n * np.diff(cumulative[::20]), n * np.diff(norm.cdf(edges))
    distance = np.sum((found - expected) ** 2 / expected)
    assert distance < chi2.isf(1e-4, 70)  # that of the sample itself is chi-square of 70
    assert distance < 35  # a smooth curve has learned less of the noise


@pytest.mark.parametrize("exponent", [1.0, 2.7])
def test_where_nothing_is_counted_a_density_goes_on_as_a_power_law(exponent):
    random = np.random.default_rng(4)
    x = random.exponential(1 / exponent, 100_000)  # ln of a Pareto variable
    fitted = density_of(x, Axis(0.0, 1.5 * float(x.max()), 80))
    far = 1.5 * x.max() + np.array([1.0, 2.0])
    slope = np.diff(along(fitted, far))[0]
    assert slope == pytest.approx(-exponent, rel=0.15)


def test_probabilities_are_learned_in_two_variables():
    random = np.random.default_rng(5)
    n = 300_000
    x, y = random.random(n), random.random(n)
    true = np.sin(5 * x) + y
    positive = random.random(n) < expit(true)
    axes = Axis(0.0, 1.0, 20), Axis(0.0, 1.0, 20)
    bins = axes[0].bin_of(x) * axes[1].bins + axes[1].bin_of(y)
    shape = axes[0].bins, axes[1].bins
    trials, counts = (
        np.bincount(some, minlength=shape[0] * shape[1]).reshape(shape) for some in (bins, bins[positive])
    )
    fitted = fit_logit(axes, counts.astype(float), trials.astype(float))
    at = np.linspace(0.02, 0.98, 25)
    np.testing.assert_allclose(fitted(at, at), np.sin(5 * at)[:, None] + at, atol=0.12)  # of 480 muons to each: 0.1
    assert np.mean(expit(fitted.at(x, y))) == pytest.approx(np.mean(positive), abs=2e-4)


def test_a_fit_has_no_randomness_of_its_own():
    values = np.random.default_rng(6).normal(size=5000)
    axis = Axis(-6.0, 6.0, 40)
    np.testing.assert_array_equal(*(density_of(values, axis).coefficients for _ in range(2)))


def test_a_fit_that_does_not_settle_is_told(monkeypatch):
    monkeypatch.setattr(splines, "_MOST_STEPS", 2)
    with pytest.raises(FailedError, match="not found in 2 steps"):
        density_of(np.random.default_rng(7).normal(size=5000), Axis(-6.0, 6.0, 40))
