from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.stats import ks_2samp

from deepmuon_runtime.muons import Muons
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.generators.transformer.fit import TransformerSettings, as_rows, features, fit_transformer
from deepmuon_training.generators.transformer.model import raw_muons
from deepmuon_training.generators.transformer.network import LATENTS, Transformer
from deepmuon_training.learning.descent import Schedule

TINY = TransformerSettings(
    d=8, batch=256, directions=4, schedule=Schedule(steps=6, learning_rate=1e-3, averaging=0.5, validate_every=2)
)


def weights(network: Transformer) -> torch.Tensor:
    return torch.cat([parameter.detach().flatten() for parameter in network.parameters()])


def test_features_are_the_deviation_of_the_energy_and_the_atanh_of_the_cosines():
    muons = Muons.of([1.0, 2.0], [0.0, 0.6], [0.0, -0.8], [-1.0, -1e-9], [13, -13])
    transform = EnergyTransform(3.0)
    expected = np.column_stack(
        [transform.pre_tanh(np.array([1.0, 2.0])), np.arctanh([0.0, 0.6]), np.arctanh([0.0, -0.8])]
    )
    np.testing.assert_allclose(features(muons, transform).numpy(), expected, rtol=1e-5, atol=1e-6)


def test_a_horizontal_muon_has_finite_features():
    muons = Muons.of([1.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1e-9, -1e-9], [13, 13])
    assert torch.all(features(muons, EnergyTransform(3.0)).isfinite())


def test_rows_keep_the_three_columns_of_a_muon_together():
    values = torch.arange(2 * 3 * 4).reshape(2, 3, 4)  # draws, columns, muons
    rows = as_rows(values)
    assert rows.shape == (8, 3)
    assert rows[5].tolist() == values[1, :, 1].tolist()


def test_the_trained_network_is_near_the_truth(transformer, transform, truth):
    rows = raw_muons(transformer, 200_000, seed=5).numpy()
    held_out = features(truth(200_000, 6), transform).numpy()
    held_out[:, 1:] = np.tanh(held_out[:, 1:])
    torch.manual_seed(0)
    untrained = raw_muons(Transformer(transformer.d), 200_000, seed=5).numpy()
    for column in range(3):
        assert ks_2samp(rows[:, column], held_out[:, column]).statistic < 0.02
        assert ks_2samp(untrained[:, column], held_out[:, column]).statistic > 0.05


def test_a_seed_gives_the_same_network_again(sample):
    muons = sample.muons[:5000]
    first, again, other = (fit_transformer(muons, seed=seed, settings=TINY, progress=False) for seed in (1, 1, 2))
    assert first[1] == again[1] == EnergyTransform.fit(muons.kinetic_energy)
    assert torch.equal(weights(first[0]), weights(again[0]))
    assert not torch.equal(weights(first[0]), weights(other[0]))


def test_training_goes_on_from_a_checkpoint(sample, tmp_path, monkeypatch):
    muons, checkpoint = sample.muons[:5000], tmp_path / "transformer.pt"
    undisturbed, _ = fit_transformer(muons, seed=1, settings=TINY, progress=False)
    passes = iter(range(6))  # of the network: four steps and a look each second one

    def dying(self, latent):
        if next(passes, None) is None:
            raise KeyboardInterrupt
        return forward(self, latent)

    forward = Transformer.forward
    with monkeypatch.context() as patch:
        patch.setattr(Transformer, "forward", dying)
        with pytest.raises(KeyboardInterrupt):
            fit_transformer(muons, seed=1, settings=TINY, checkpoint=checkpoint, progress=False)
    assert checkpoint.exists()
    resumed, _ = fit_transformer(muons, seed=1, settings=TINY, checkpoint=checkpoint, progress=False)
    assert torch.equal(weights(resumed), weights(undisturbed))


def test_the_validating_muons_train_nothing(sample):
    muons = sample.muons[:5000]  # the last twentieth validates
    changed = Muons.concatenate([muons[:4750], muons[:250]])
    settings = replace(TINY, schedule=replace(TINY.schedule, validate_every=6))
    transform = EnergyTransform.fit(muons.kinetic_energy)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(EnergyTransform, "fit", classmethod(lambda cls, energies: transform))
        networks = [fit_transformer(m, seed=1, settings=settings, progress=False)[0] for m in (muons, changed)]
    assert torch.equal(*map(weights, networks))


def test_each_step_sees_d_muons_for_each_draw(sample, monkeypatch):
    shapes = []
    forward = Transformer.forward

    def watched(self, latent):
        shapes.append(tuple(latent.shape))
        return forward(self, latent)

    monkeypatch.setattr(Transformer, "forward", watched)
    fit_transformer(sample.muons[:4000], seed=1, settings=TINY, progress=False)
    assert shapes.count((256 // 8, LATENTS)) == 6
