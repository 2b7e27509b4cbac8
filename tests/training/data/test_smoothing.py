"""Closure on a known smooth flux: binned into CRY's cells, made uniform in them, and smoothed again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ks_2samp

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.data.cry_cells import COS_ZENITH_EDGES, ENERGY_CELL
from deepmuon_training.data.smoothing import StepSmoother
from deepmuon_training.data.smoothing import smoothed as smoothed_sample
from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.sample import Sample

N = 2_000_000
CELLS = [ENERGY_CELL * np.arange(-15, 26), COS_ZENITH_EDGES]
NOISE = 0.87 * np.sqrt(2 / N)
"""Mean KS distance of two samples of one distribution."""


def step(muons, seed):
    """Make muons uniform in log energy and cos zenith within CRY's cells."""
    random = np.random.default_rng(seed)
    x, c = np.log10(muons.kinetic_energy.astype(float)), muons.cos_zenith.astype(float)
    x = (np.floor(x / ENERGY_CELL) + random.random(len(x))) * ENERGY_CELL
    c = (np.minimum(np.floor(20 * c), 19) + random.random(len(c))) / 20
    stretch = np.sqrt(1 - c**2) / np.hypot(muons.u, muons.v)
    return Muons.of(10**x, muons.u * stretch, muons.v * stretch, -c, muons.pdg_id)


def cells(muons):
    return np.histogram2d(np.log10(muons.kinetic_energy), muons.cos_zenith, CELLS)[0]


def distance(a, b, column):
    return ks_2samp(getattr(a, column), getattr(b, column), method="asymp").statistic


def reaches(muons, depth):
    """Whether a muon of continuous loss dE/dx = a + b E, 0.22 GeV/m and 3.5e-4 /m in water, gets to a depth."""
    a, b = 0.22, 3.5e-4
    return np.log1p(b / a * muons.kinetic_energy.astype(float)) / b * muons.cos_zenith > depth


@pytest.fixture(scope="module")
def truth():
    return sea_level_muons(N, seed=1)


@pytest.fixture(scope="module")
def stepped(truth):
    return step(truth, seed=2)


@pytest.fixture(scope="module")
def smoothed(stepped):
    return StepSmoother(stepped)(stepped)


@pytest.mark.parametrize("column", ["kinetic_energy", "cos_zenith", "u"])
def test_a_known_smooth_flux_comes_back_within_the_noise(truth, smoothed, column):
    # They have the truth's cell contents, so their distance should even be below that of independent samples.
    assert distance(smoothed, truth, column) < NOISE


@pytest.mark.parametrize("column", ["kinetic_energy", "cos_zenith"])
def test_the_steps_themselves_are_seen_by_the_same_distance(truth, stepped, column):
    assert distance(stepped, truth, column) > 3 * NOISE


def test_twenty_bins_in_a_decade_agree_with_the_smooth_flux(truth, smoothed):
    # Both hold the same muons, cell by cell, so chi2/ndf is at most 1 in the mean where nothing is wrong.
    # 1.4 is four standard deviations of chi2/ndf for the 80 bins above 1000 muons: one false alarm in ten thousand.
    edges = np.arange(-2, 3, 0.05)
    found, expected = (np.histogram(np.log10(m.kinetic_energy), edges)[0] for m in (smoothed, truth))
    full = expected > 1000
    chi2 = np.sum((found - expected)[full] ** 2 / (found + expected)[full])
    assert chi2 / full.sum() < 1.4


def test_as_many_muons_reach_50_metres_as_of_the_smooth_flux(truth, stepped, smoothed):
    expected = reaches(truth, 50).sum()
    assert abs(reaches(stepped, 50).sum() / expected - 1) > 0.02
    assert abs(reaches(smoothed, 50).sum() / expected - 1) < 0.003


def test_every_cell_keeps_its_content(stepped, smoothed):
    before, after = cells(stepped), cells(smoothed)
    full = before > 1000
    assert np.sqrt(np.mean((after[full] / before[full] - 1) ** 2)) < 0.01


def test_muons_that_were_not_fitted_are_smoothed_by_the_same_maps(stepped):
    others = step(sea_level_muons(N // 2, seed=3), seed=4)
    smooth = StepSmoother(stepped)(others)
    independent = sea_level_muons(N, seed=5)
    # 1.95 sqrt(1/n + 1/m) is exceeded once in a thousand.
    assert distance(smooth, independent, "kinetic_energy") < 1.95 * np.sqrt(3 / N)
    assert distance(smooth, independent, "cos_zenith") < 1.95 * np.sqrt(3 / N)


def test_muons_of_unknown_charge_share_one_map(stepped):
    alike = replace(stepped, pdg_id=np.zeros(N, np.int8))
    smooth = StepSmoother(alike)(alike)
    np.testing.assert_array_equal(smooth.pdg_id, 0)
    before, after = cells(stepped), cells(smooth)
    full = before > 1000
    assert np.sqrt(np.mean((after[full] / before[full] - 1) ** 2)) < 0.01


def test_muons_of_a_charge_that_was_not_fitted_are_refused(stepped):
    few = stepped[:100_000]
    with pytest.raises(RefusedError, match="of a charge that those had not"):
        StepSmoother(few[few.pdg_id == 13])(few)


@pytest.mark.parametrize("count", [1, 1000, 3000])
def test_too_few_muons_are_refused(stepped, count):
    with pytest.raises(RefusedError, match="too few to take the steps of CRY's tables out"):
        StepSmoother(stepped[stepped.pdg_id == 13][:count])


def test_muons_of_two_energies_are_refused():
    muons = sea_level_muons(20_000, seed=6)
    energy = np.where(np.arange(20_000) % 2, 1.0, 100.0).astype(np.float32)
    with pytest.raises(RefusedError, match="too few"):
        StepSmoother(replace(muons, kinetic_energy=energy, pdg_id=np.full(20_000, 13, np.int8)))


def test_a_smoothed_sample_says_so_and_keeps_its_rate_to_the_muons_that_are_left(stepped):
    sample = Sample(stepped[:200_000], depth_m=0.0, source="the tests", rate=100.0, smoothed=False)
    smooth = smoothed_sample(sample, StepSmoother(sample.muons))
    assert smooth.smoothed
    assert smooth.rate == pytest.approx(100.0 * len(smooth) / 200_000)
    assert smooth.provenance == (
        f"steps of CRY's tables taken out, {200_000 - len(smooth)} muons moved below 1 MeV dropped",
    )
    assert smooth.muons.kinetic_energy.min() >= 1e-3
    assert smoothed_sample(replace(sample, rate=None), StepSmoother(sample.muons)).rate is None


def test_order_charge_and_azimuth_stay(stepped, smoothed):
    np.testing.assert_array_equal(smoothed.pdg_id, stepped.pdg_id)
    turned = np.angle((smoothed.u + 1j * smoothed.v) / (stepped.u + 1j * stepped.v))
    assert np.abs(turned).max() < 1e-2


def test_muons_keep_their_rank_within_a_cell(stepped, smoothed):
    inside = (stepped.pdg_id == 13) & (stepped.kinetic_energy > 10**0.4) & (stepped.kinetic_energy < 10**0.6)
    order = np.argsort(stepped.kinetic_energy[inside])
    assert np.all(np.diff(smoothed.kinetic_energy[inside][order]) >= 0)


def test_directions_stay_unit_vectors(smoothed):
    length = smoothed.u.astype(float) ** 2 + smoothed.v.astype(float) ** 2 + smoothed.w.astype(float) ** 2
    np.testing.assert_allclose(length, 1, atol=1e-6)
    assert np.all(smoothed.w < 0)


@pytest.mark.parametrize("energy", [2e-4, 9e4], ids=["below", "above"])
def test_a_muon_outside_of_every_fitted_cell_keeps_its_energy(stepped, energy):
    # Its rank among the fitted ones is 0 or 1, whose quantile lay at 3e14 GeV once.
    cos_zenith = 0.9
    muon = Muons.of(np.array([energy]), np.array([np.sqrt(1 - cos_zenith**2)]), [0.0], [-cos_zenith], [13])
    assert StepSmoother(stepped[stepped.kinetic_energy < 1e4])(muon).kinetic_energy[0] == pytest.approx(energy)
