from __future__ import annotations

import numpy as np
import torch

from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.learning.charge import fit_charge
from deepmuon_training.learning.descent import Schedule


def test_the_probability_of_the_training_charges_is_learned(charge, transform, truth, charge_truth):
    muons = truth(50_000, seed=2)
    energy, cos_zenith = muons.kinetic_energy.astype(float), muons.cos_zenith.astype(float)
    y = torch.from_numpy(transform.pre_tanh(energy)).float()
    with torch.no_grad():
        found = torch.sigmoid(charge(y, torch.from_numpy(muons.cos_zenith))).numpy()
    expected = charge_truth(energy, cos_zenith)
    assert np.std(expected) > 0.06  # what a constant probability would miss
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.01


def test_muons_beyond_the_ends_of_the_sample_share_their_probability(charge):
    low, high = charge.condition.low, charge.condition.high
    with torch.no_grad():
        logit = charge(torch.tensor([low, low - 5, high, high + 5]), torch.full((4,), 0.8))
    assert logit[0] == logit[1]
    assert logit[2] == logit[3]
    assert logit[0] < logit[2]


def weights(network):
    return torch.cat([parameter.detach().flatten() for parameter in network.parameters()])


def test_a_seed_gives_the_same_probability_again(truth):
    muons = truth(10_000, seed=3)
    transform = EnergyTransform.fit(muons.kinetic_energy)
    schedule = Schedule(steps=3, learning_rate=0.01, validate_every=1)
    first, again, other = (
        weights(fit_charge(muons, transform, seed=seed, schedule=schedule, progress=False)) for seed in (1, 1, 2)
    )
    assert torch.equal(first, again)
    assert not torch.equal(first, other)
