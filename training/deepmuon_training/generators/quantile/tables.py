"""The `quantile` generator's maps as tables, and their evaluation in PyTorch.

The five latents of a muon, uniform in (-1, 1):

0, 1
    Energy, by t, the logit of its level: `deepmuon_training.generators.quantile.cells.energy_logit`. The second fills
    the gaps of the first, whose float32 steps would end the spectrum at one muon in ten million; together they reach a
    tail probability of 2^-48.
2
    Zenith, by the logit of its level (1 + l2) / 2.
3
    Azimuth, pi l3; or where it is learned, see `azimuth_table`.
4
    Charge: +1 where l4 < 2 P(mu+) - 1; P is tabulated beside the zenith.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import expit

from deepmuon_runtime.errors import FailedError
from deepmuon_training.export.graph import Graph
from deepmuon_training.export.graph_steps import LARGEST_LATENT
from deepmuon_training.generators.quantile.azimuth_table import LEVEL_KNOTS, TAIL_KNOTS, azimuth_turn
from deepmuon_training.generators.quantile.cells import (
    ENERGY_PER_UNIT,
    ROW_OF_CELL,
    column_logits,
    energy_logit,
    energy_logits,
    row_logits,
    zenith_square,
)
from deepmuon_training.generators.quantile.graph import ENERGY_LATENTS, LATENT_SIZE, NEAREST_HORIZON, quantile_graph
from deepmuon_training.generators.quantile.look_ups import LookUps, look_ups
from deepmuon_training.generators.quantile.maps import QuantileGenerator

__all__ = ["LATENT_SIZE", "QuantileTables", "TableError", "table_error", "tabulate"]

Float32 = NDArray[np.float32]


@dataclass(frozen=True)
class QuantileTables:
    """The numbers of an exported `quantile` model, all float32.

    Parameters
    ----------
    energy : [2177]
        ln E/GeV over t from -34 to 34.
    zenith : [65, 129]
        Logit cos zenith over the rows of t and the logit of the zenith's level from -17.5 to 17.5.
    charge : [65, 129]
        2 P(mu+) - 1 over the same.
    energy_range : tuple of float
        Lowest and highest kinetic energy [GeV].
    energy_mean : float
        Mean of the transformed energy in training; for the record.
    azimuth : [41, 33, 129] or None
        As in `azimuth_table`; None where it is uniform.
    """

    energy: Float32
    zenith: Float32
    charge: Float32
    energy_range: tuple[float, float]
    energy_mean: float
    azimuth: Float32 | None = None

    architecture = "quantile"
    latent_size = LATENT_SIZE
    energy_latents = ENERGY_LATENTS
    muons_per_draw = 1

    def __call__(self, latent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Evaluate in PyTorch: kinetic energy [n] in GeV, direction [n, 3] and charge [n] of latents [n, 5]."""
        latent = latent.clamp(-LARGEST_LATENT, LARGEST_LATENT)
        l0, l1, l2, l3, l4 = latent.unbind(dim=1)
        tables = self._look_ups(latent.dtype)
        t = energy_logit(l0, l1)
        place = t * ENERGY_PER_UNIT
        cell = place.trunc().long()
        energy = tables.energy_start[cell] + place * tables.energy_slope[cell]
        row, square = tables.row[cell], zenith_square(l2)
        cell = row + square.sqrt().trunc().long()
        versine = tables.versine_start[cell] + square * tables.versine_slope[cell]
        versine = versine.clamp(0, 1 - NEAREST_HORIZON)
        sine = torch.sqrt(versine * (2 - versine))
        turn = l3
        if self.azimuth is not None:
            turn = azimuth_turn(torch.from_numpy(self.azimuth), t, torch.log((1 + l2) / (1 - l2)), l3)
        azimuth = torch.pi * turn
        direction = torch.stack([sine * torch.cos(azimuth), sine * torch.sin(azimuth), versine - 1], dim=1)
        charge = torch.where(l4 < tables.charge[cell], 1, -1).to(torch.int8)
        return energy.clamp(*self.energy_range), direction, charge

    def _look_ups(self, dtype: torch.dtype) -> LookUps:
        return look_ups(*(torch.from_numpy(table).to(dtype) for table in (self.energy, self.zenith, self.charge)))

    def graph(self) -> tuple[Graph, str, str, str]:
        """Build the same in ONNX; returns the graph and the names of its energy, direction and charge."""
        g = Graph()
        coarse = {"energy": self.energy, "zenith": self.zenith, "charge": self.charge}
        energy, zenith, charge = (g.constant(table, f"{name}/table") for name, table in coarse.items())
        return g, *quantile_graph(g, energy, zenith, charge, self.energy_range, self.azimuth)


def tabulate(generator: QuantileGenerator) -> QuantileTables:
    """Evaluate a generator's maps on the tables' knots.

    Raises
    ------
    FailedError
        If a map is no number somewhere.
    """
    energy = generator.log_energy(energy_logits().numpy())
    columns, t = column_logits().numpy(), row_logits().numpy()
    zenith = generator.cos_zenith_logit(columns, t)
    for name, values in (("energy", energy), ("zenith", zenith)):
        if not np.isfinite(values).all():
            raise FailedError(f"the {name} map is no number somewhere: its density was not learned")
    positive = generator.charge_logit(np.repeat(t, len(columns)), zenith.ravel())
    return QuantileTables(
        energy=energy.astype(np.float32),
        zenith=zenith.astype(np.float32),
        charge=np.tanh(positive / 2).reshape(zenith.shape).astype(np.float32),
        energy_range=generator.energy_range,
        energy_mean=generator.transform.mean,
        azimuth=_azimuth(generator),
    )


def _azimuth(generator: QuantileGenerator) -> Float32 | None:
    """Evaluate the azimuth's network on its table's knots."""
    if generator.azimuth is None:
        return None
    t, levels = TAIL_KNOTS.numpy(), LEVEL_KNOTS.numpy()
    y = torch.from_numpy(generator.y(t)).repeat_interleave(len(levels))
    cos_zenith = torch.from_numpy(expit(generator.cos_zenith_logit(levels, t))).flatten()
    with torch.no_grad():
        cumulative = copy.deepcopy(generator.azimuth).double().cumulative(y, cos_zenith)
    return (2 * cumulative - 1).float().reshape(len(t), len(levels), -1).numpy()


@dataclass(frozen=True)
class TableError:
    """How far tables are from the maps they were made of, root mean square and largest.

    The zenith is compared at the energy of the row that a muon reads.

    Parameters
    ----------
    energy, largest_energy
        Relative.
    cos_zenith, largest_cos_zenith
        Absolute.
    """

    energy: float
    largest_energy: float
    cos_zenith: float
    largest_cos_zenith: float

    def __str__(self) -> str:
        """Say it in a sentence."""
        return (
            f"The tables differ from the maps by {self.energy:.1e} of the energy (rms; at most "
            f"{self.largest_energy:.1e}) and {self.cos_zenith:.1e} in cos zenith "
            f"(at most {self.largest_cos_zenith:.1e})."
        )


def table_error(generator: QuantileGenerator, tables: QuantileTables, *, seed: int, muons: int = 100_000) -> TableError:
    """Compare tables with maps on random latents."""
    latent = 2 * torch.rand(muons, LATENT_SIZE, generator=torch.Generator().manual_seed(seed), dtype=torch.float64) - 1
    found_energy, direction, _ = tables(latent)
    t = energy_logit(latent[:, 0], latent[:, 1])
    row = ROW_OF_CELL[(t * ENERGY_PER_UNIT).trunc().long().numpy()]
    level, cos_zenith = torch.logit((1 + latent[:, 2]) / 2).numpy(), np.empty(muons)
    for number, at in enumerate(row_logits().numpy()):
        mine = row == number
        cos_zenith[mine] = expit(generator.cos_zenith_logit(level[mine], np.array([at]))[0])
    energy = np.abs(found_energy.numpy() / np.exp(generator.log_energy(t.numpy())) - 1)
    angle = np.abs(-direction[:, 2].numpy() - cos_zenith)
    return TableError(_rms(energy), float(energy.max()), _rms(angle), float(angle.max()))


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))
