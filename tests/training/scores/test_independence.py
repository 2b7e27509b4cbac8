from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.scores.independence import Independence, measure_independence

SIZE = 1_024_000


@pytest.fixture(scope="module")
def clean() -> Muons:
    return sea_level_muons(SIZE, seed=1)


def sigmas(score: Independence) -> list[float]:
    parts = (*score.variance_between_positions, *score.autocorrelations, *score.block_means)
    return [score.positions.sigma, *(part.sigma for part in parts)]


def in_order_of_energy(muons: Muons) -> Muons:
    return muons[np.argsort(muons.kinetic_energy)]


def stratified_draws(muons: Muons, size: int, *, shuffled: bool) -> Muons:
    """Draws with one muon of each energy quantile, as a transformer makes them."""
    strata = np.argsort(muons.kinetic_energy).reshape(size, -1)
    draws = np.random.default_rng(2).permuted(strata, axis=1).T
    return muons[(np.random.default_rng(3).permuted(draws, axis=1) if shuffled else draws).ravel()]


@pytest.mark.parametrize("muons_per_draw", [1, 2, 100, 1024])
def test_independent_muons_raise_no_alarm(clean, muons_per_draw):
    # at most 30 scores within 4 sigma: a false alarm in 500
    score = measure_independence(clean, muons_per_draw)
    assert score.period_is_nominal == (muons_per_draw == 1)
    assert max(abs(sigma) for sigma in sigmas(score)) < 4
    assert score.repeats.muons == 0


def test_every_sigma_of_independent_muons_is_a_standard_normal_deviate():
    # 60 sequences: means and spreads of 21 scores within 4.5 of their errors 0.13 and 0.09, below 1e-3
    scores = np.array([sigmas(measure_independence(sea_level_muons(100_000, seed=seed))) for seed in range(60)])
    assert np.abs(scores.mean(axis=0)).max() < 0.58
    assert np.abs(scores.std(axis=0) - 1).max() < 0.41


@pytest.mark.parametrize("length", [128, 1000])
def test_sorted_blocks_are_seen(clean, length):
    order = np.argsort(clean.kinetic_energy.reshape(-1, length), axis=1)
    muons = clean[(order + np.arange(0, SIZE, length)[:, None]).ravel()]
    score = measure_independence(muons)
    first = score.autocorrelations[0]
    assert (first.column, first.lag) == ("log10 E", 1)
    assert first.correlation > 0.5
    assert first.sigma > 100
    assert abs(score.positions.sigma) > 4  # positions differ, or are all too much alike


def test_antithetic_pairs_are_seen(clean):
    ordered = in_order_of_energy(clean)
    random = np.random.default_rng(2)
    first = random.permutation(SIZE // 2)
    first = np.where(random.random(len(first)) < 0.5, first, SIZE - 1 - first)  # either of a pair comes first
    score = measure_independence(ordered[np.stack([first, SIZE - 1 - first], axis=1).ravel()])
    assert score.autocorrelations[0].correlation == pytest.approx(-0.5, abs=0.05)
    energy = [block for block in score.block_means if block.column == "log10 E"]
    assert all(block.ratio < 0.2 and block.sigma < -50 for block in energy)


def test_a_drift_along_the_sequence_is_seen(clean):
    drift = np.linspace(0.8, 1.2, SIZE, dtype=np.float32)
    score = measure_independence(replace(clean, kinetic_energy=clean.kinetic_energy * drift))
    longest = max((block for block in score.block_means if block.column == "log10 E"), key=lambda b: b.length)
    assert longest.sigma > 10


def test_stratified_draws_are_more_even_than_independent_muons(clean):
    score = measure_independence(stratified_draws(clean, 64, shuffled=True), 64)
    assert abs(score.positions.sigma) < 4
    assert all(block.sigma < -10 for block in score.block_means if block.column == "log10 E")


def test_positions_that_are_not_alike_are_seen(clean):
    score = measure_independence(stratified_draws(clean, 64, shuffled=False), 64)
    energy, zenith = score.variance_between_positions
    assert score.positions.sigma > 100
    assert energy.share > 0.9
    assert zenith.share < 0.3


def test_repeated_muons_are_counted_exactly(clean):
    random = np.random.default_rng(2)
    source = np.arange(SIZE)
    source[random.choice(SIZE, 10_000, replace=False)] = random.integers(0, SIZE, 10_000)
    muons = clean[source]
    repeats = measure_independence(muons).repeats
    assert repeats.muons == SIZE - len(np.unique(source)) > 9000
    assert repeats.energies - repeats.energies_expected > 4 * repeats.energies_noise


def test_a_muon_that_differs_in_one_column_is_no_repeat(clean):
    muons = clean[np.arange(SIZE) // 2]
    second = np.arange(SIZE) % 2 == 1
    for name in ("kinetic_energy", "u", "v", "w"):
        column = np.where(second, np.nextafter(getattr(muons, name), np.float32(2)), getattr(muons, name))
        assert measure_independence(replace(muons, **{name: column})).repeats.muons == 0
    opposite = replace(muons, pdg_id=np.where(second, -muons.pdg_id, muons.pdg_id).astype(np.int8))
    assert measure_independence(opposite).repeats.muons == 0


def test_repeated_energies_are_those_that_rounding_to_float32_explains():
    # 30 sequences: mean and spread of the pull within 4 of their errors 0.18 and 0.13, a false alarm in 8,000
    pulls = []
    for seed in range(30):
        repeats = measure_independence(sea_level_muons(200_000, seed=seed)).repeats
        pulls.append((repeats.energies - repeats.energies_expected) / repeats.energies_noise)
    assert abs(np.mean(pulls)) < 0.73
    assert abs(np.std(pulls) - 1) < 0.52


def test_energies_of_a_coarse_grid_are_seen(clean):
    bits = clean.kinetic_energy.view(np.uint32) & np.uint32(0xFFFFFF00)
    assert measure_independence(replace(clean, kinetic_energy=bits.view(np.float32))).repeats.energies_ratio > 12


def test_a_beam_without_spread_is_no_failure():
    muons = sea_level_muons(100_000, seed=1)
    zero = np.zeros_like(muons.u)
    score = measure_independence(Muons(zero + 4, zero, zero, zero - 1, muons.pdg_id))
    assert score.block_means == ()
    assert score.positions.ndf == 0
    assert score.repeats.muons == 99_998


def test_too_short_a_sequence_is_refused(clean):
    with pytest.raises(RefusedError, match="need 102400"):
        measure_independence(clean[:100_000], 1024)
    with pytest.raises(RefusedError, match="at least 1"):
        measure_independence(clean, 0)
