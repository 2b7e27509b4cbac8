from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.scores.histograms import (
    ENERGY_EDGES,
    compare_cells,
    compare_charge,
    compare_energy_bins,
    compare_tails,
    compare_zenith_bins,
    count_muons,
)


@pytest.fixture(scope="module")
def truth() -> Muons:
    return sea_level_muons(1_000_000, seed=1)


@pytest.fixture(scope="module")
def generated() -> Muons:
    return sea_level_muons(2_000_000, seed=2)


def shares(muons: Muons) -> np.ndarray:
    counts = count_muons(muons)
    return counts / counts.sum()


def test_every_muon_is_counted_once_in_its_cell():
    energy = np.array([0.001, 0.0101, 1.0, 2e4], np.float32)
    cos_zenith = np.array([0.01, 0.06, 1.0, 0.5], np.float32)
    sine = np.sqrt(1 - cos_zenith**2)
    pdg_id = np.array([MU_PLUS, MU_MINUS, MU_PLUS, MU_MINUS], np.int8)
    counts = count_muons(Muons(energy, sine, 0 * sine, -cos_zenith, pdg_id))
    assert {tuple(cell.tolist()) for cell in np.argwhere(counts == 1)} == {
        (1, 0, 0),
        (0, 1, 1),
        (1, 21, 19),
        (0, 51, 10),
    }
    assert counts.sum() == 4


def test_alike_samples_of_any_sizes_agree(truth, generated):
    # four scores within 4 sigma: a false alarm in 4,000
    p, q = count_muons(generated), count_muons(truth)
    assert abs(compare_cells(p, q).chi_square.sigma) < 4
    assert abs(compare_charge(p, q).sigma) < 4
    assert max(abs(tail.pull) for tail in compare_tails(generated, truth)) < 4
    assert max(abs(bin_.pull) for bin_ in compare_energy_bins(p, q)) < 4.5
    assert max(abs(bin_.pull) for bin_ in compare_zenith_bins(generated, truth)) < 4.5


@pytest.mark.parametrize("sizes", [(20e6, 2e6), (2e6, 2e6), (2e6, 20e6)])
def test_sigma_of_alike_tables_is_a_standard_normal_deviate(truth, sizes):
    # 200 tables: mean and standard deviation within 4 of their errors 0.07 and 0.05, a false alarm in 8,000
    random, density = np.random.default_rng(3), shares(truth)
    tables = [[random.poisson(size * density) for size in sizes] for _ in range(200)]
    for sigma in (
        [compare_cells(*pair).chi_square.sigma for pair in tables],
        [compare_charge(*pair).sigma for pair in tables],
    ):
        assert abs(np.mean(sigma)) < 0.28
        assert abs(np.std(sigma) - 1) < 0.2


@pytest.mark.parametrize("sizes", [(20e6, 2e6), (4e6, 4e6)])
def test_delta_is_the_relative_difference_at_any_size(truth, sizes):
    # 2 % up and down, from cell to cell, is 2.00 % +- 0.1 %: 4 sigma
    density = shares(truth)
    _, energy_bin, zenith_cell = np.indices(density.shape)
    sign = np.where(((energy_bin + 1) // 2 + zenith_cell) % 2, 1, -1)  # two energy bins make a cell
    random = np.random.default_rng(4)
    p = random.poisson(sizes[0] * density * (1 + 0.02 * sign))
    q = random.poisson(sizes[1] * density)
    score = compare_cells(p, q)
    assert score.delta == pytest.approx(0.02, abs=0.004)
    assert score.delta > 2 * score.delta_noise
    assert score.chi_square.sigma > 5


def test_an_energy_bin_reports_its_planted_deviation(truth):
    random = np.random.default_rng(5)
    density = shares(truth)
    planted = density.copy()
    planted[:, 25] *= 1.03
    p, q = random.poisson(20e6 * planted), random.poisson(20e6 * density)
    worst = max(compare_energy_bins(p, q), key=lambda bin_: abs(bin_.pull))
    assert (worst.low, worst.high) == (ENERGY_EDGES[24], ENERGY_EDGES[25])
    assert abs(worst.deviation - 0.03) < 0.003 + 4 * worst.error  # 3 % of it raises the total by 0.2 %
    assert worst.pull == pytest.approx(worst.deviation / worst.error)


def test_a_ripple_near_the_vertical_is_seen_in_the_zenith_bins(truth, generated):
    zenith = np.degrees(np.arccos(np.minimum(generated.cos_zenith, 1)))
    dropped = (zenith > 6) & (zenith < 8) & (np.random.default_rng(5).random(len(generated)) < 0.1)
    bins = compare_zenith_bins(generated[~dropped], truth)
    worst = max(bins, key=lambda bin_: abs(bin_.pull))
    assert (worst.low, worst.high) == (6, 8)
    assert abs(worst.deviation + 0.1) < 4 * worst.error


def test_thin_energy_bins_are_left_out(truth):
    bins = compare_energy_bins(count_muons(truth), count_muons(truth[:500_000]))
    assert min(bin_.held_out for bin_ in bins) >= 10_000
    assert 0 < len(bins) < 50


def test_a_cut_tail_is_missed(truth, generated):
    tails = {tail.name: tail for tail in compare_tails(generated[generated.kinetic_energy < 300], truth)}
    assert tails["above 300 GeV"].found == 0
    assert tails["above 300 GeV"].pull < -10
    assert tails["above 1 TeV"].pull < -4
    assert abs(tails["below 20 MeV"].pull) < 4


def test_near_horizontal_muons_that_are_too_many_are_seen(truth, generated):
    horizontal = generated[generated.cos_zenith < 0.2]
    tails = compare_tails(Muons.concatenate([generated, horizontal]), truth)
    assert next(tail.pull for tail in tails if tail.name == "cos zenith below 0.2") > 10


def test_muons_of_one_charge_are_seen(truth, generated):
    minus = replace(generated, pdg_id=np.full_like(generated.pdg_id, MU_MINUS))
    assert compare_charge(count_muons(minus), count_muons(truth)).sigma > 100


def test_a_charge_that_follows_the_energy_is_seen_though_its_ratio_is_right(truth, generated):
    plus = generated.kinetic_energy < np.quantile(generated.kinetic_energy, 1.28 / 2.28)
    sorted_out = replace(generated, pdg_id=np.where(plus, MU_PLUS, MU_MINUS).astype(np.int8))
    assert np.mean(sorted_out.charge > 0) == pytest.approx(np.mean(truth.charge > 0), abs=0.003)
    assert compare_charge(count_muons(sorted_out), count_muons(truth)).sigma > 100


def test_the_charge_of_muons_of_one_charge_is_not_compared(truth):
    counts = count_muons(truth[truth.charge < 0])
    assert compare_charge(counts, counts).per_ndf is None
