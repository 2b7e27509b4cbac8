from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chi2, ks_2samp
from support.terminal import terminal

from deepmuon_runtime import Generator
from deepmuon_training.export.metadata import Training
from deepmuon_training.export.onnx_export import export
from deepmuon_training.generators.quantile.fit import fit_quantile
from deepmuon_training.generators.quantile.tables import tabulate

N = 500_000
NOISE = 1.63 * np.sqrt(1 / N + 1 / 100_000)
"""KS distance that 100,000 and 500,000 muons of one distribution exceed once in a hundred."""


@pytest.fixture(scope="module")
def generated(quantile_tables, sample, tmp_path_factory):
    path = tmp_path_factory.mktemp("quantile") / "model.onnx"
    export(quantile_tables, Training.of(sample, seed=1), path)
    return Generator.open(file=path, device="cpu", threads=1).sample(N, seed=1)


@pytest.fixture(scope="module")
def held_out(truth):
    return truth(N, 99)


def distance(a, b, column):
    return ks_2samp(getattr(a, column), getattr(b, column), method="asymp").statistic


@pytest.mark.parametrize("column", ["kinetic_energy", "u", "v", "cos_zenith"])
def test_generated_muons_are_near_the_truth(generated, held_out, column):
    assert distance(generated, held_out, column) < NOISE


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.3), (0.3, 1.0), (1.0, 3.0), (3.0, 10.0), (10.0, 30.0), (30.0, 1e5)])
def test_generated_zenith_angles_are_near_the_truth_at_any_energy(generated, held_out, sample, low, high):
    trained, *parts = (
        m[(m.kinetic_energy >= low) & (m.kinetic_energy < high)] for m in (sample.muons, generated, held_out)
    )
    # The training muons themselves are farther from the truth than this once in a hundred.
    noise = 1.63 * np.sqrt(sum(1 / len(part) for part in (trained, *parts)))
    assert distance(*parts, "cos_zenith") < noise


@pytest.mark.parametrize(("low", "high"), [(1e-3, 0.02), (100.0, 300.0), (300.0, 1e5)])
def test_generated_tails_are_those_of_the_truth(generated, held_out, low, high):
    found, expected = (np.sum((m.kinetic_energy >= low) & (m.kinetic_energy < high)) for m in (generated, held_out))
    sigma = np.sqrt(found + expected + expected**2 * N / 100_000 / expected)  # of the training sample too
    assert abs(found - expected) < 4 * sigma
    assert expected > 100


def test_near_the_horizon_generated_muons_are_as_rare_as_true_ones(generated, held_out):
    for low, high in pairwise((0, 0.05, 0.1, 0.15, 0.2)):
        found, expected = (np.sum((m.cos_zenith >= low) & (m.cos_zenith < high)) for m in (generated, held_out))
        # Of the training sample, too, and a smooth curve may be off by as much as it errs.
        assert abs(found - expected) < 4 * np.sqrt(found + expected + expected**2 * N / 100_000 / expected)


def test_generated_charges_follow_energy_and_zenith(generated, charge_truth):
    energy, cos_zenith = generated.kinetic_energy.astype(float), generated.cos_zenith.astype(float)
    expected = charge_truth(energy, cos_zenith)
    for column in (energy, cos_zenith):
        edges = np.quantile(column, np.linspace(0, 1, 9))
        for low, high in pairwise(edges):
            inside = (column >= low) & (column <= high)
            assert abs(np.mean(generated.charge[inside] > 0) - np.mean(expected[inside])) < 0.015
        assert np.ptp(expected) > 0.3


def test_the_probability_of_a_positive_charge_is_right_on_the_whole(generated, sample):
    """Of the sample's own: the constant of its logit is fitted without a penalty."""
    share = np.mean(sample.muons.charge > 0)
    assert abs(np.mean(generated.charge > 0) - share) < 4 * np.sqrt(share * (1 - share) / N) + 1e-4


def test_there_is_neither_a_hole_nor_a_ripple_around_the_vertical(generated, held_out):
    """Once the first cell of the tables had no muon near the vertical, and every further one a step in the density."""
    edges = np.array([0, 0.3, 0.6, 1, 1.5, 2, 3, 4, 6, 8, 10, 12, 15])
    found, true = (
        np.histogram(np.degrees(np.arccos(m.cos_zenith.astype(float))), edges)[0] for m in (generated, held_out)
    )
    solid_angle = -np.diff(np.cos(np.radians(edges)))
    even = found[-3:].sum() / solid_angle[-3:].sum() * solid_angle  # the flux is flat there, within 2 per cent
    assert chi2.sf(np.sum((found - even)[:6] ** 2 / even[:6]), 6) > 1e-4
    assert chi2.sf(np.sum((found - true) ** 2 / (found + true)), len(found)) > 1e-4


@pytest.fixture(scope="module")
def few(sample):
    return sample.muons[:20_000]


def test_the_same_muons_give_the_same_generator_whatever_the_seed(few):
    """But for a learned azimuth nothing is random."""
    once, again = (tabulate(fit_quantile(few, seed=seed, progress=False)) for seed in (1, 2))
    for name in ("energy", "zenith", "charge"):
        np.testing.assert_array_equal(getattr(once, name), getattr(again, name))


def test_progress_is_shown_only_if_wanted(few, monkeypatch):
    shown = terminal(monkeypatch)
    fit_quantile(few, seed=1, progress=False)
    assert shown.getvalue() == ""
    fit_quantile(few, seed=1)
    assert "energy, zenith, charge" in shown.getvalue()
