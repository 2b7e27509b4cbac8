from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit, logit
from scipy.stats import chi2

from deepmuon_runtime.errors import FailedError
from deepmuon_training.export.graph_steps import LARGEST_LATENT
from deepmuon_training.generators.quantile.tables import LATENT_SIZE, QuantileTables, table_error, tabulate

LATENT = st.floats(-1, 1, width=32)


def evaluate(tables: QuantileTables, latent, dtype=torch.float64):
    energy, direction, charge = tables(torch.as_tensor(latent, dtype=dtype))
    return energy.numpy(), direction.numpy(), charge.numpy()


def energies(tables, l0, l1, dtype=torch.float64):
    l0, l1 = np.broadcast_arrays(l0, l1)
    latent = np.zeros((l0.size, LATENT_SIZE))
    latent[:, 0], latent[:, 1] = l0.ravel(), l1.ravel()
    return evaluate(tables, latent, dtype)[0]


def random_latents(n: int, seed: int) -> np.ndarray:
    return 2 * np.random.default_rng(seed).random((n, LATENT_SIZE)) - 1


def test_the_energys_knots_are_at_least_16_to_a_decade_of_tail_probability(quantile_tables):
    knots = (len(quantile_tables.energy) - 1) / 2
    decades = 34 / np.log(10)  # of tail probability, on each side
    assert 10.0**-decades < 2.0**-48
    assert knots / decades >= 16


def test_the_zeniths_knots_are_at_least_3_to_a_unit_of_the_levels_logit(quantile_tables):
    rows, columns = quantile_tables.zenith.shape
    assert quantile_tables.charge.shape == (rows, columns)
    assert (columns - 1) / 2 / 17.5 >= 3
    assert np.log(2**25 - 1) < 17.5


@pytest.mark.parametrize("side", [-1, 1])
def test_the_tail_is_continuous_down_to_2_to_the_minus_48(quantile, side):
    endless = replace(quantile, energy_range=(1e-15, 1e21))  # energies that would be flat near their ends
    p = 2.0 ** -np.arange(23, 48.25, 0.25)
    l1 = p * 2.0**24 - 1
    assert l1.min() == -LARGEST_LATENT
    found = energies(tabulate(endless), side * LARGEST_LATENT, l1)
    right = np.exp(endless.log_energy(side * np.log(2 / p - 1)))  # p is a half's tail, p / 2 the whole's
    np.testing.assert_allclose(found, right, rtol=1e-3)
    assert np.all(np.diff(found) * side > 0)


@pytest.mark.parametrize("side", [-1, 1])
def test_the_second_latent_fills_the_gaps_of_the_first(quantile_tables, side):
    l0 = side * (LARGEST_LATENT - 2.0**-23 * np.arange(1000))  # neighbours among the runtime's latents
    nearer, farther = energies(quantile_tables, l0, 1.0), energies(quantile_tables, l0, -1.0)
    np.testing.assert_allclose(nearer[:-1], farther[1:], rtol=1e-6)
    assert np.all((farther - nearer) * side > 0)


def test_the_second_latent_works_in_float32_where_it_matters(quantile_tables):
    l1 = np.linspace(1, -LARGEST_LATENT, 10_000)
    single = energies(quantile_tables, LARGEST_LATENT, l1, torch.float32)
    np.testing.assert_allclose(single, energies(quantile_tables, LARGEST_LATENT, l1), rtol=2e-5)
    assert np.all(np.diff(single) >= 0)
    assert len(np.unique(single)) > 5000


@given(latent=st.lists(LATENT, min_size=LATENT_SIZE, max_size=LATENT_SIZE))
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_no_latent_makes_an_unphysical_muon(quantile_tables, latent, dtype):
    (energy,), (direction,), (charge,) = evaluate(quantile_tables, [latent], dtype)
    low, high = np.float32(quantile_tables.energy_range)
    assert low * (1 - 1e-7) <= energy <= high * (1 + 1e-7)
    assert direction[2] < 0
    assert np.linalg.norm(direction.astype(float)) == pytest.approx(1, abs=1e-6)
    assert charge in (-1, 1)


def test_end_points_are_clamped_to_the_largest_latent(quantile_tables):
    for end in (-1.0, 1.0):
        at_the_end, inside = (
            evaluate(quantile_tables, np.full((1, LATENT_SIZE), end * size)) for size in (1.0, LARGEST_LATENT)
        )
        for a, b in zip(at_the_end, inside, strict=True):
            np.testing.assert_array_equal(a, b)


@given(l0=st.lists(st.floats(-1, 1), min_size=2, max_size=2, unique=True))
def test_the_energy_rises_with_its_latent(quantile_tables, l0):
    low, high = energies(quantile_tables, np.sort(l0), 0.0)
    assert low <= high


@given(l0=st.floats(-1, 1), l2=st.lists(st.floats(-1, 1), min_size=2, max_size=2, unique=True))
def test_cos_zenith_rises_with_its_latent_at_any_energy(quantile_tables, l0, l2):
    latent = [[l0, 0, level, 0, 0] for level in sorted(l2)]
    _, direction, _ = evaluate(quantile_tables, latent)
    assert direction[0, 2] >= direction[1, 2] - 1e-15


def test_the_azimuth_is_pi_times_its_latent(quantile_tables):
    latent = random_latents(1000, 1)
    _, direction, _ = evaluate(quantile_tables, latent)
    np.testing.assert_allclose(np.arctan2(direction[:, 1], direction[:, 0]), np.pi * latent[:, 3], atol=1e-9)


def test_charges_follow_the_maps(quantile, quantile_tables):
    latent = random_latents(200_000, 2)
    energy, direction, charge = evaluate(quantile_tables, latent)
    t = quantile.energy_logit(np.log(energy))
    probability = expit(quantile.charge_logit(t, logit(-direction[:, 2])))
    # Muon by muon they differ where a neighbouring row was read; in any bin of energy and zenith their shares agree.
    edges = [np.quantile(column, np.linspace(0, 1, 9)[1:-1]) for column in (energy, direction[:, 2])]
    bins = 8 * np.digitize(energy, edges[0]) + np.digitize(direction[:, 2], edges[1])
    surplus = np.bincount(bins, (charge == 1) - probability)
    variance = np.bincount(bins, probability * (1 - probability))
    assert chi2.sf(np.sum(surplus**2 / variance), len(variance)) > 1e-5  # the rate of false alarms


def test_tables_are_near_their_maps(quantile, quantile_tables):
    error = table_error(quantile, quantile_tables, seed=1, muons=50_000)
    assert error.energy < 2e-4
    assert error.largest_energy < 2e-3
    assert error.cos_zenith < 1e-4
    assert error.largest_cos_zenith < 2e-3
    for number in (error.energy, error.largest_energy, error.cos_zenith, error.largest_cos_zenith):
        assert f"{number:.1e}" in str(error)


def test_a_planted_error_of_a_table_is_seen(quantile, quantile_tables):
    tilted = quantile_tables.zenith + np.float32(0.1)
    error = table_error(quantile, replace(quantile_tables, zenith=tilted), seed=1, muons=10_000)
    assert error.cos_zenith > 0.01
    moved = quantile_tables.energy + np.float32(0.009)  # of the logarithm
    error = table_error(quantile, replace(quantile_tables, energy=moved), seed=1, muons=10_000)
    assert error.energy == pytest.approx(0.009, rel=0.1)


def test_tables_are_float32_and_the_same_again(quantile, quantile_tables):
    again = tabulate(quantile)
    for name in ("energy", "zenith", "charge"):
        assert getattr(again, name).dtype == np.float32
        np.testing.assert_array_equal(getattr(again, name), getattr(quantile_tables, name))
    assert again.energy_range == (1e-3, 1e5)


def test_a_map_that_is_no_number_is_not_tabulated(quantile):
    broken = replace(quantile.zenith, coefficients=quantile.zenith.coefficients * np.nan)
    with pytest.raises(FailedError, match="the zenith map"):
        tabulate(replace(quantile, zenith=broken))
