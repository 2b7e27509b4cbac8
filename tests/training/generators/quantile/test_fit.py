from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import torch
from scipy.stats import ks_2samp
from support.terminal import terminal

from deepmuon_runtime import Generator
from deepmuon_training.export.metadata import Training
from deepmuon_training.export.onnx_export import export
from deepmuon_training.generators.quantile.fit import QuantileSchedules, fit_quantile
from deepmuon_training.generators.quantile.regression import RegressionSteps
from deepmuon_training.learning import charge
from deepmuon_training.learning.descent import Schedule

N = 500_000
NOISE = 1.63 * np.sqrt(1 / N + 1 / 100_000)
"""KS distance that 100,000 and 500,000 muons of one distribution exceed once in a hundred."""

TINY = QuantileSchedules(
    zenith=RegressionSteps(adam=20, round=5, rounds=1),
    charge=Schedule(steps=4, learning_rate=1e-2, averaging=0.5, validate_every=2),
)


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


@pytest.mark.parametrize(
    ("column", "limit"), [("kinetic_energy", NOISE), ("u", NOISE), ("v", NOISE), ("cos_zenith", 0.01)]
)
def test_generated_muons_are_near_the_truth(generated, held_out, column, limit):
    assert distance(generated, held_out, column) < limit


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.3), (0.3, 1.0), (1.0, 3.0), (3.0, 10.0), (10.0, 30.0), (30.0, 1e5)])
def test_generated_zenith_angles_are_near_the_truth_at_any_energy(generated, held_out, sample, low, high):
    trained, *parts = (
        m[(m.kinetic_energy >= low) & (m.kinetic_energy < high)] for m in (sample.muons, generated, held_out)
    )
    # The training muons themselves are farther from the truth than this once in a hundred; 0.01 is for the short fit.
    noise = 1.63 * np.sqrt(sum(1 / len(part) for part in (trained, *parts)))
    assert distance(*parts, "cos_zenith") < noise + 0.01


@pytest.mark.parametrize(("low", "high"), [(1e-3, 0.02), (100.0, 300.0), (300.0, 1e5)])
def test_generated_tails_are_those_of_the_truth(generated, held_out, low, high):
    found, expected = (np.sum((m.kinetic_energy >= low) & (m.kinetic_energy < high)) for m in (generated, held_out))
    sigma = np.sqrt(found + expected + expected**2 * N / 100_000 / expected)  # of the training sample too
    assert abs(found - expected) < 4 * sigma
    assert expected > 100


def test_near_the_horizon_generated_muons_are_as_rare_as_true_ones(generated, held_out):
    found, expected = (np.sum(m.cos_zenith < 0.2) for m in (generated, held_out))
    assert found == pytest.approx(expected, rel=0.1)


def test_generated_charges_follow_energy_and_zenith(generated, charge_truth):
    energy, cos_zenith = generated.kinetic_energy.astype(float), generated.cos_zenith.astype(float)
    expected = charge_truth(energy, cos_zenith)
    for column in (energy, cos_zenith):
        edges = np.quantile(column, np.linspace(0, 1, 9))
        for low, high in pairwise(edges):
            inside = (column >= low) & (column <= high)
            assert abs(np.mean(generated.charge[inside] > 0) - np.mean(expected[inside])) < 0.015
        assert np.ptp(expected) > 0.3


def weights(network):
    return torch.cat([parameter.detach().flatten() for parameter in network.parameters()])


@pytest.fixture(scope="module")
def few(sample):
    return sample.muons[:20_000]


@pytest.fixture(scope="module")
def undisturbed(few):
    return fit_quantile(few, seed=1, schedules=TINY, progress=False)


def test_a_seed_gives_the_same_generator_again(few, undisturbed):
    again, other = (fit_quantile(few, seed=seed, schedules=TINY, progress=False) for seed in (1, 2))
    assert torch.equal(weights(again), weights(undisturbed))
    assert again.tails == undisturbed.tails
    assert not torch.equal(weights(other), weights(undisturbed))


def test_a_killed_training_goes_on_to_the_same_generator(few, undisturbed, tmp_path, monkeypatch):
    calls = iter(range(4))
    cross_entropy = charge.binary_cross_entropy_with_logits

    def dying(*arguments):
        if next(calls, None) is None:
            raise KeyboardInterrupt
        return cross_entropy(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(charge, "binary_cross_entropy_with_logits", dying)
        with pytest.raises(KeyboardInterrupt):
            fit_quantile(few, seed=1, schedules=TINY, checkpoint_folder=tmp_path, progress=False)
    assert (tmp_path / "charge.pt").exists()
    resumed = fit_quantile(few, seed=1, schedules=TINY, checkpoint_folder=tmp_path, progress=False)
    assert torch.equal(weights(resumed), weights(undisturbed))
    assert resumed.tails == undisturbed.tails


def test_progress_is_shown_only_if_wanted(few, monkeypatch):
    shown = terminal(monkeypatch)
    fit_quantile(few, seed=1, schedules=TINY, progress=False)
    assert shown.getvalue() == ""
    fit_quantile(few, seed=1, schedules=TINY)
    assert "charge:" in shown.getvalue()
    assert "zenith" in shown.getvalue()
