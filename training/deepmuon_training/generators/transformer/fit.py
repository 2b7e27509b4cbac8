"""Trains the `transformer` generator with the sliced Wasserstein loss."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
from torch import nn

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.generators.transformer.network import HEADS, LATENTS, Transformer
from deepmuon_training.generators.transformer.sliced_wasserstein import (
    deepmuon_loss,
    random_directions,
    sliced_wasserstein,
)
from deepmuon_training.learning.charge import CHARGE_SCHEDULE
from deepmuon_training.learning.checkpoint import fingerprint
from deepmuon_training.learning.descent import Schedule, fit
from deepmuon_training.learning.validation import training_rows
from deepmuon_training.ranges import Range, check_ranges

__all__ = ["TransformerSettings", "features", "fit_transformer"]

_VALIDATION_DIRECTIONS = 64
_LARGEST_COSINE = 1 - 1e-6


@dataclass(frozen=True)
class TransformerSettings:
    """Size and training; the default made the released models.

    Parameters
    ----------
    d
        Width of the network; 1024 in the paper.
    batch
        Muons in a batch, a multiple of d; 307,200 in the paper.
    directions
        Random projections a step; 2048 in the paper.
    schedule
        Steps and rates.
    charge
        Of the charge's probability, which is a network of its own.
    calibration
        Muons of the trained network that its table of zenith angles is made of.

    Raises
    ------
    RefusedError
        If a value is out of its range, d is not a multiple of 8, the network's heads, or the batch has not d muons.
    """

    d: Annotated[int, Range(HEADS, 16_384)] = 128
    batch: Annotated[int, Range(HEADS, 100_000_000)] = 32768
    directions: Annotated[int, Range(1, 100_000)] = 32
    schedule: Schedule = Schedule(
        steps=6000, learning_rate=1e-3, weight_decay=0.01, averaging=0.998, validate_every=250, patience=16
    )
    charge: Schedule = CHARGE_SCHEDULE
    calibration: Annotated[int, Range(1000, 1_000_000_000)] = 4_000_000

    def __post_init__(self) -> None:
        """Refuse a network that can't be."""
        check_ranges(self)
        if self.d % HEADS:
            raise RefusedError(f"d is {self.d}, and should be a multiple of {HEADS}: the network has so many heads")
        if self.batch < self.d:
            raise RefusedError(f"a batch of {self.batch} muons is less than one draw of {self.d}")


def features(muons: Muons, transform: EnergyTransform) -> torch.Tensor:
    """Return the pre-tanh values [n, 3] of muons: x - mean of the energy, atanh cos x, atanh cos y."""
    cosines = [np.arctanh(np.clip(column, -_LARGEST_COSINE, _LARGEST_COSINE)) for column in (muons.u, muons.v)]
    columns = [transform.pre_tanh(muons.kinetic_energy), *cosines]
    return torch.from_numpy(np.stack([column.astype(np.float32) for column in columns], axis=1))


def fit_transformer(
    muons: Muons,
    *,
    seed: int,
    settings: TransformerSettings | None = None,
    checkpoint: Path | None = None,
    device: str = "cpu",
    progress: bool = True,
) -> tuple[Transformer, EnergyTransform]:
    """Train a network on muons, the last of which validate (`validation.training_rows`).

    Parameters
    ----------
    muons
        In no particular order.
    seed
        Of weights and batches.
    settings
        Size and training.
    checkpoint
        File to save to and, where it exists, to go on from.
    device
        "cpu" or "cuda".
    progress
        Whether to show a progress bar.
    """
    settings = settings or TransformerSettings()
    torch.manual_seed(seed)
    transform = EnergyTransform.fit(muons.kinetic_energy)
    network = Transformer(settings.d).to(device)
    columns = features(muons, transform)
    truth = columns.to(device)
    training, validation = truth.tensor_split([training_rows(len(truth))])
    held = len(validation)
    draws = settings.batch // settings.d

    def loss(network: nn.Module, random: torch.Generator) -> torch.Tensor:
        latent = 2 * torch.rand(draws, LATENTS, generator=random) - 1
        rows = torch.randint(len(training), (draws * settings.d,), generator=random)
        directions = random_directions(settings.directions, 3, random).to(device)
        return deepmuon_loss(as_rows(network(latent.to(device))), training[rows.to(device)], directions)

    fixed = torch.Generator().manual_seed((seed + 1) % 2**64)
    validation_latent = (2 * torch.rand(-(-held // settings.d), LATENTS, generator=fixed) - 1).to(device)
    validation_directions = random_directions(_VALIDATION_DIRECTIONS, 3, fixed).to(device)

    def distance(network: nn.Module) -> float:
        generated = as_rows(network(validation_latent))[:held]
        return float(sliced_wasserstein(generated, validation, validation_directions))

    fit(
        network,
        loss,
        distance,
        settings.schedule,
        seed=seed,
        name="transformer",
        data=fingerprint(columns.numpy()) + f", batch {settings.batch}, {settings.directions} directions",
        checkpoint=checkpoint,
        progress=progress,
    )
    return network.cpu(), transform


def as_rows(values: torch.Tensor) -> torch.Tensor:
    """Reshape [draws, 3, d] to one row a muon [draws d, 3]."""
    return values.transpose(1, 2).reshape(-1, 3)
