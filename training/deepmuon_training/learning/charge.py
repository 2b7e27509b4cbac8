"""The probability of a positive charge, given energy and zenith."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import expit
from torch import nn
from torch.nn.functional import binary_cross_entropy_with_logits

from deepmuon_runtime.muons import Muons
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.learning.checkpoint import fingerprint
from deepmuon_training.learning.condition import EnergyCondition
from deepmuon_training.learning.descent import Schedule, fit
from deepmuon_training.learning.perceptron import perceptron
from deepmuon_training.learning.validation import split

__all__ = ["CHARGE_SCHEDULE", "ChargeProbability", "fit_charge"]

CHARGE_SCHEDULE = Schedule(steps=3000, learning_rate=0.005, averaging=0.998, validate_every=250, patience=8)
"""How the released models' charges were trained."""

_BATCH = 32768
_CHUNK = 1 << 20  # muons whose logits are found at once: bounds the memory


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

    @torch.no_grad()
    def raise_by(self, logit: float) -> None:
        """Add a constant to all logits; infinity where all muons are of one charge."""
        last = self.network[-1]
        assert isinstance(last, nn.Linear)
        if np.isinf(logit):
            last.weight.zero_()
        last.bias.add_(logit)


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
    """Train the network by cross entropy, then set its constant so that the mean charge is that of all the muons.

    Cross entropy sees the mean charge of 32,768 muons at a time, and the best step is that of the validation muons:
    left alone, it follows their mean charge. Muons of one charge have a probability of exactly 0 or 1, and nothing to
    learn.

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
    positive = float(np.mean(columns[2], dtype=np.float64))
    if positive in (0.0, 1.0):
        network.raise_by(np.inf if positive else -np.inf)
        return network

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
    network.raise_by(_missing_logit(network, columns, positive))
    return network


def _missing_logit(network: ChargeProbability, columns: tuple[NDArray[np.float32], ...], positive: float) -> float:
    """Return the constant to be added to the logits so that their mean probability is `positive`."""
    parts = []
    with torch.no_grad():
        for first in range(0, len(columns[0]), _CHUNK):
            y, cos_zenith = (torch.from_numpy(column[first : first + _CHUNK]) for column in columns[:2])
            parts.append(network(y, cos_zenith).double().numpy())
    logit = np.concatenate(parts)

    def excess(constant: float) -> float:
        return float(np.mean(expit(logit + constant))) - positive

    farthest = float(np.abs(logit).max()) + 40  # where every probability is 0 or 1
    return float(brentq(excess, -farthest, farthest))
