"""Families of `quantile` maps, of knots that differ as muons under more and more water do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.latents.philox import latents
from deepmuon_training.families.rates import KnownRate
from deepmuon_training.generators.quantile.family import QuantileFamily, quantile_family
from deepmuon_training.generators.quantile.tables import QuantileTables

DEPTHS = (0.0, 0.3, 1.0, 3.0, 10.0, 30.0)
PLANE, SPHERE = 0, 1


def under(tables: QuantileTables, depth: float) -> QuantileTables:
    """The same muons, of more energy and steeper: by a parabola in s, which interpolation through four is exact for."""
    s = np.log((depth + 0.7) / 0.7)
    energy = np.clip(tables.energy + 0.3 * s + 0.05 * s**2, np.log(1e-3), np.log(1e5))
    return replace(
        tables,
        energy=energy.astype(np.float32),
        zenith=(tables.zenith + 0.2 * s).astype(np.float32),
        charge=np.clip(tables.charge * (1 - 0.1 * s), -1, 1).astype(np.float32),
    )


@pytest.fixture(scope="module")
def family(quantile_tables) -> QuantileFamily:
    rates = [KnownRate(depth, 120 / (1 + depth / 9)) for depth in (*DEPTHS, 5.0)]
    rates.sort(key=lambda known: known.depth_m)
    return quantile_family([(depth, under(quantile_tables, depth)) for depth in DEPTHS], 1.0, rates)


def muons(tables: QuantileTables, n: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    latent = torch.from_numpy(latents(seed=seed, first=0, draws=n, latent_size=5)).double()
    energy, direction, charge = tables(latent)
    return energy.numpy(), -direction[:, 2].numpy(), charge.numpy()


def test_at_a_knot_the_tables_are_its_own(family, quantile_tables):
    for depth in DEPTHS:
        found, own = family.at(depth), under(quantile_tables, depth)
        for name in "energy", "zenith", "charge":
            np.testing.assert_array_equal(getattr(found, name), getattr(own, name).astype(np.float64), err_msg=name)


@given(st.floats(0, 30, width=32))
def test_between_knots_muons_are_where_they_should_be(family, quantile_tables, depth):
    found, right = family.at(depth), under(quantile_tables, depth)
    within = (right.energy > np.log(1e-2)) & (right.energy < np.log(1e4))  # cut at no knot
    np.testing.assert_allclose(found.energy[within], right.energy[within], atol=1e-5)
    np.testing.assert_allclose(found.zenith, right.zenith, atol=1e-5)
    np.testing.assert_allclose(found.charge, right.charge, atol=1e-5)


@given(st.floats(0, 30, width=32), st.sampled_from([PLANE, SPHERE]))
def test_maps_rise_at_every_depth(family, depth, surface):
    found = family.at(depth, surface)
    assert np.all(np.diff(found.energy) >= 0)
    assert np.all(np.diff(found.zenith, axis=1) >= 0)
    assert np.all(np.abs(found.charge) <= 1)


@pytest.mark.parametrize("depth", [0.0, 2.0, 30.0])
def test_the_spheres_muons_weighted_by_cos_zenith_are_the_planes(family, depth):
    """In bins of both, and in rate; false alarms of all three depths together: 1 in 3000 seeds."""
    n = 400_000
    edges = np.array([0, 0.5, 1, 2, 5, 10, 30, 100, np.inf]), np.array([0.05, 0.2, 0.4, 0.6, 0.7, 0.8, 0.9, 0.95, 1])
    energy, cosine, charge = muons(family.at(depth), n)
    counts = np.histogram2d(energy, cosine * charge, bins=(edges[0], [*-edges[1][::-1], *edges[1]]))[0]
    energy, cosine, charge = muons(family.at(depth, SPHERE), n, seed=2)
    ratio = family.rate(depth, SPHERE) / family.rate(depth, PLANE)
    bins = edges[0], [*-edges[1][::-1], *edges[1]]
    weights = np.histogram2d(energy, cosine * charge, bins=bins, weights=ratio * cosine)[0]
    squares = np.histogram2d(energy, cosine * charge, bins=bins, weights=(ratio * cosine) ** 2)[0]
    enough = counts > 50
    assert enough.sum() > 60
    variance = counts + squares - (counts**2 + weights**2) / n
    score = np.sum((counts - weights)[enough] ** 2 / variance[enough])
    assert chi2.sf(score, enough.sum()) > 1e-4
    assert np.sum(weights) / np.sum(counts) == pytest.approx(1, abs=4 / np.sqrt(n))


def test_the_rate_of_a_knot_and_of_a_further_depth_are_as_stated(family):
    for depth in (*DEPTHS, 5.0):
        assert family.rate(depth) == pytest.approx(120 / (1 + depth / 9), rel=1e-9)
    assert 1.1 < family.rate(4.0, SPHERE) / family.rate(4.0, PLANE) < 1.6


def test_muons_of_one_charge_stay_of_one_charge(quantile_tables):
    positive = replace(quantile_tables, charge=np.ones_like(quantile_tables.charge))
    family = quantile_family([(depth, positive) for depth in DEPTHS], 1.0, [])
    assert np.all(family.at(7.3).charge == 1)


def test_the_notes_say_how_far_a_knot_is_from_what_its_neighbours_make_of_it(family, quantile_tables):
    (note,) = family.notes
    assert "that of 0.3 m is hardest" in note or "by 0.0% of the energy" in note
    two = quantile_family([(0.0, quantile_tables), (1.0, quantile_tables)], 1.0, [])
    assert "no knot between" in two.notes[0]


def test_a_learned_azimuth_is_refused(quantile_tables):
    learned = replace(quantile_tables, azimuth=np.zeros((41, 33, 129), dtype=np.float32))
    with pytest.raises(RefusedError, match="the generator of 1 m has a learned azimuth"):
        quantile_family([(0.0, quantile_tables), (1.0, learned)], 1.0, [])
