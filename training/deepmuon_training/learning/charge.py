"""The probability of a positive charge, given energy and zenith."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn.functional import binary_cross_entropy_with_logits

from deepmuon_runtime.muons import Muons
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.learning.checkpoint import fingerprint
from deepmuon_training.learning.condition import EnergyCondition
from deepmuon_training.learning.descent import Schedule, fit
from deepmuon_training.learning.monotone import perceptron
from deepmuon_training.learning.validation import split

__all__ = ["CHARGE_SCHEDULE", "ChargeProbability", "fit_charge"]

CHARGE_SCHEDULE = Schedule(steps=3000, learning_rate=0.005, averaging=0.998, validate_every=250, patience=8)
"""How the released models' charges were trained."""

_BATCH = 32768


class ChargeProbability(nn.Module):
    """logit P(mu+ | energy, zenith) as a small network.

    Parameters
    ----------
    condition
        Scales the energy coordinate.
    """

    def __init__(self, condition: EnergyCondition) -> None:
        super().__init__()
        self.condition = condition
        self.network = perceptron(2, 32, 32, 1)

    def forward(self, y: torch.Tensor, cos_zenith: torch.Tensor) -> torch.Tensor:
        """Return the logit [n] at energy coordinates y [n] and cos zenith [n]."""
        result: torch.Tensor = self.network(torch.stack([self.condition(y), cos_zenith], dim=-1))
        return result.squeeze(-1)


@dataclass(frozen=True)
class _Columns:
    y: torch.Tensor
    cos_zenith: torch.Tensor
    positive: torch.Tensor

    def entropy(self, network: nn.Module, rows: torch.Tensor | slice = slice(None)) -> torch.Tensor:
        """Cross entropy of the charges and their probabilities."""
        return binary_cross_entropy_with_logits(network(self.y[rows], self.cos_zenith[rows]), self.positive[rows])


def fit_charge(
    muons: Muons,
    transform: EnergyTransform,
    *,
    seed: int,
    schedule: Schedule = CHARGE_SCHEDULE,
    checkpoint: Path | None = None,
    progress: bool = True,
) -> ChargeProbability:
    """Train the network by cross entropy.

    Parameters
    ----------
    muons
        In no particular order; the last ones validate (`validation.training_rows`).
    transform
        Makes the energy coordinate.
    seed
        Of weights and batches.
    schedule, checkpoint, progress
        As in `deepmuon_training.learning.descent.fit`.
    """
    torch.manual_seed(seed)
    y = transform.pre_tanh(muons.kinetic_energy.astype(np.float64)).astype(np.float32)
    columns = (y, muons.cos_zenith, (muons.charge > 0).astype(np.float32))
    training, validation = (_Columns(*map(torch.from_numpy, part)) for part in split(*columns))
    network = ChargeProbability(EnergyCondition.fit(y))

    def loss(network: nn.Module, random: torch.Generator) -> torch.Tensor:
        return training.entropy(network, torch.randint(len(training.y), (_BATCH,), generator=random))

    def distance(network: nn.Module) -> float:
        return float(validation.entropy(network))

    fit(
        network,
        loss,
        distance,
        schedule,
        seed=seed,
        name="charge",
        data=fingerprint(*columns),
        checkpoint=checkpoint,
        progress=progress,
    )
    return network
