from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from deepmuon_runtime.muons import MU_MINUS, MU_PLUS
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


def generated_share(network, transform, muons):
    """Mean probability of mu+ that a network gives to muons."""
    y = torch.from_numpy(transform.pre_tanh(muons.kinetic_energy.astype(float))).float()
    with torch.no_grad():
        return torch.sigmoid(network(y, torch.from_numpy(muons.cos_zenith)).double()).mean().item()


@pytest.mark.parametrize("steps", [1, 30, 300])
def test_the_mean_charge_is_that_of_all_the_muons_whatever_validates(transform, truth, steps):
    muons = truth(20_000, seed=4)
    last = np.arange(len(muons)) >= 19_000  # these validate, and are of one charge
    muons = replace(muons, pdg_id=np.where(last, MU_MINUS, muons.pdg_id).astype(np.int8))
    schedule = Schedule(steps=steps, learning_rate=0.01, averaging=0.998, validate_every=10)
    network = fit_charge(muons, transform, seed=1, schedule=schedule, progress=False)
    assert generated_share(network, transform, muons) == pytest.approx(np.mean(muons.charge > 0), abs=1e-6)


@pytest.mark.parametrize("pdg_id", [MU_MINUS, MU_PLUS])
def test_muons_of_one_charge_have_no_other_by_any_chance(transform, truth, pdg_id):
    muons = truth(5000, seed=5)
    muons = replace(muons, pdg_id=np.full_like(muons.pdg_id, pdg_id))
    network = fit_charge(muons, transform, seed=1, progress=False)
    assert generated_share(network, transform, muons) == (pdg_id == MU_PLUS)


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
