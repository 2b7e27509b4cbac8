"""Trains the azimuth of a `quantile` generator, given energy and zenith, where it is not uniform."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import expit
from torch import nn

from deepmuon_runtime.muons import Muons
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.generators.quantile.circular_density import CircularDensity
from deepmuon_training.learning.checkpoint import fingerprint
from deepmuon_training.learning.condition import EnergyCondition
from deepmuon_training.learning.descent import Schedule, fit
from deepmuon_training.learning.validation import split

__all__ = ["AZIMUTH_BINS", "AZIMUTH_SCHEDULE", "AzimuthDensity", "fit_azimuth"]

AZIMUTH_SCHEDULE = Schedule(steps=4000, learning_rate=0.01, averaging=0.99, validate_every=100, patience=10)

AZIMUTH_BINS = 128
"""Parts of the circle, of 2.8 degrees, inside of which the azimuth is uniform."""

_ENERGY_BINS = np.arange(-9, 9.1, 0.25)  # logit of the levels that bound them: the sparse ends are resolved too
_ZENITH_BINS = np.arange(-7, 7.1, 0.4)

Float32 = NDArray[np.float32]


class AzimuthDensity(nn.Module):
    """p(azimuth | energy, zenith) as a small network.

    Parameters
    ----------
    condition
        Scales the energy coordinate.
    """

    def __init__(self, condition: EnergyCondition) -> None:
        super().__init__()
        self.condition = condition
        self.density = CircularDensity(conditions=2, hidden=64, harmonics=16, bins=AZIMUTH_BINS)

    def forward(self, y: torch.Tensor, cos_zenith: torch.Tensor) -> torch.Tensor:
        """Return the logarithm of each azimuth bin's probability [n, 128], given y [n] and cos zenith [n]."""
        result: torch.Tensor = self.density(self._conditions(y, cos_zenith))
        return result

    def cumulative(self, y: torch.Tensor, cos_zenith: torch.Tensor) -> torch.Tensor:
        """Return the cumulative distribution [n, 129] from -pi to pi, given y [n] and cos zenith [n]."""
        return self.density.cumulative(self._conditions(y, cos_zenith))

    def _conditions(self, y: torch.Tensor, cos_zenith: torch.Tensor) -> torch.Tensor:
        return torch.stack([self.condition(y), 2 * cos_zenith - 1], dim=-1)


def fit_azimuth(
    muons: Muons,
    transform: EnergyTransform,
    *,
    seed: int,
    schedule: Schedule = AZIMUTH_SCHEDULE,
    checkpoint: Path | None = None,
    progress: bool = True,
) -> AzimuthDensity:
    """Train the network by maximum likelihood of the muons, counted in some 2,000 cells of energy and zenith.

    Parameters
    ----------
    muons
        In no particular order; the last ones validate (`validation.training_rows`).
    transform
        Makes the energy coordinate.
    seed
        Of the weights.
    schedule, checkpoint, progress
        As in `deepmuon_training.learning.descent.fit`.
    """
    torch.manual_seed(seed)
    y = transform.pre_tanh(muons.kinetic_energy.astype(np.float64)).astype(np.float32)
    edges = _edges(y, _ENERGY_BINS), _edges(muons.cos_zenith, _ZENITH_BINS)
    columns = np.arctan2(muons.v, muons.u), y, muons.cos_zenith
    training, validation = (_Cells.count(edges, *part) for part in split(*columns))
    network = AzimuthDensity(EnergyCondition.fit(y))

    def loss(network: nn.Module, random: torch.Generator) -> torch.Tensor:
        return training.surprise(network)

    def distance(network: nn.Module) -> float:
        return float(validation.surprise(network))

    fit(
        network,
        loss,
        distance,
        schedule,
        seed=seed,
        name="azimuth",
        data=fingerprint(*columns),
        checkpoint=checkpoint,
        progress=progress,
    )
    return network


def _edges(values: Float32, logit: NDArray[np.float64]) -> Float32:
    """Return the inner edges of bins whose levels have these logits."""
    return np.quantile(values, expit(logit)).astype(np.float32)


@dataclass(frozen=True)
class _Cells:
    """Mean y and cos zenith of each cell's muons [cells], and the share of all in its azimuth bins [cells, 128]."""

    y: torch.Tensor
    cos_zenith: torch.Tensor
    share: torch.Tensor

    @classmethod
    def count(cls, edges: tuple[Float32, Float32], azimuth: Float32, y: Float32, cos_zenith: Float32) -> _Cells:
        cell = np.digitize(y, edges[0]) * (len(edges[1]) + 1) + np.digitize(cos_zenith, edges[1])
        part = np.clip(((azimuth / np.pi + 1) * (AZIMUTH_BINS / 2)).astype(np.intp), 0, AZIMUTH_BINS - 1)
        size = (len(edges[0]) + 1) * (len(edges[1]) + 1)
        number = np.bincount(cell, minlength=size)
        filled = number > 0
        means = (np.bincount(cell, column, size)[filled] / number[filled] for column in (y, cos_zenith))
        share = np.bincount(cell * AZIMUTH_BINS + part, minlength=size * AZIMUTH_BINS).reshape(size, AZIMUTH_BINS)
        return cls(*(torch.from_numpy(column).float() for column in (*means, share[filled] / len(y))))

    def surprise(self, network: nn.Module) -> torch.Tensor:
        """Mean over the muons of minus the logarithm of their bin's probability."""
        logarithm: torch.Tensor = network(self.y, self.cos_zenith)
        return -(self.share * logarithm).sum()
