"""The `quantile` generator's maps as tables, and their evaluation, in PyTorch and as an ONNX graph.

The five latents of a muon, uniform in (-1, 1):

0, 1
    Energy. The tail probability ``p = (1 - |l0|) + 2^-24 l1`` fills the gaps of l0, whose float32 steps would
    end the spectrum at one muon in ten million; it reaches down to 2^-48. The table lies evenly in
    t = -sign(l0) log p, which is the logit of the level but for a bounded term.
2
    Zenith. The table lies evenly in t and in the logit of the level (1 + l2) / 2, and holds logit cos zenith.
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
from onnx import TensorProto

from deepmuon_runtime.errors import FailedError
from deepmuon_training.energy_transform import box_cox
from deepmuon_training.export.graph import Graph
from deepmuon_training.export.graph_steps import (
    LARGEST_LATENT,
    bilinear,
    bilinear_cells,
    charge_sign,
    columns,
    interpolation_cells,
    kinetic_energy,
    linear,
    locate,
    matrix,
    on_plane,
    place,
)
from deepmuon_training.generators.quantile.azimuth_table import (
    LEVEL_KNOTS,
    TAIL_KNOTS,
    azimuth_turn,
    azimuth_turn_graph,
)
from deepmuon_training.generators.quantile.maps import QuantileGenerator

__all__ = ["LATENT_SIZE", "QuantileTables", "TableError", "table_error", "tabulate"]

LATENT_SIZE = 5

_FINE_STEP = 2.0**-24
_ENERGY_REACH = 34.0  # -log(2^-48) = 33.3
_ENERGY_KNOTS = 1920  # on each side; 130 to a decade of tail probability
_ROW_REACH = 10.0  # log tail probability of the energy where its condition stops changing
_ROWS = 40  # on each side
_COLUMN_REACH = 17.5  # logit of the outermost zenith level: log(2^25 - 1) = 17.3
_COLUMNS = 64  # on each side

Float32 = NDArray[np.float32]


@dataclass(frozen=True)
class QuantileTables:
    """The numbers of an exported `quantile` model, all float32.

    Parameters
    ----------
    energy : [2 K + 1]
        x = (9 E / MeV + 1)^(1/9) over t from -34 to 34.
    zenith : [2 R + 1, 2 C + 1]
        logit cos zenith over t from -10 to 10 and the logit of the zenith level from -17.5 to 17.5.
    charge : [2 R + 1, 2 C + 1]
        2 P(mu+) - 1 over the same.
    energy_range : tuple of float
        Lowest and highest kinetic energy [GeV].
    energy_mean : float
        Mean of x that the networks were trained with; for the record.
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
    muons_per_draw = 1

    def __call__(self, latent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Evaluate in PyTorch: kinetic energy [n] in GeV, direction [n, 3] and charge [n] of latents [n, 5]."""
        latent = latent.clamp(-LARGEST_LATENT, LARGEST_LATENT)
        l0, l1, l2, l3, l4 = latent.unbind(dim=1)
        t = -torch.sign(l0) * torch.log((1 - l0.abs()) + _FINE_STEP * l1)
        cell, inside = locate(t, _ENERGY_KNOTS / _ENERGY_REACH)
        x = linear(torch.from_numpy(self.energy), cell + _ENERGY_KNOTS, inside)
        row, a = locate(t.clamp(-_ROW_LIMIT, _ROW_LIMIT), _ROWS / _ROW_REACH)
        tail = 1 - l2.abs()
        level = torch.sign(l2) * torch.log((2 - tail) / tail)
        column, b = locate(level, _COLUMNS / _COLUMN_REACH)
        logit, threshold = (
            bilinear(torch.from_numpy(table), row + _ROWS, a, column + _COLUMNS, b)
            for table in (self.zenith, self.charge)
        )
        odds = torch.exp(-logit)
        cos_zenith = 1 / (1 + odds)
        sine = torch.sqrt(odds * cos_zenith * (1 + cos_zenith))
        turn = l3 if self.azimuth is None else azimuth_turn(torch.from_numpy(self.azimuth), t, level, l3)
        azimuth = torch.pi * turn
        direction = torch.stack([sine * torch.cos(azimuth), sine * torch.sin(azimuth), -cos_zenith], dim=1)
        charge = torch.where(l4 < threshold, 1, -1).to(torch.int8)
        return box_cox(x).clamp(*self.energy_range), direction, charge

    def graph(self) -> tuple[Graph, str, str, str]:
        """Build the same in ONNX; returns the graph and the names of its energy, direction and charge."""
        g = Graph()
        l0, l1, l2, l3, l4 = columns(g, g("Clip", "latent", -LARGEST_LATENT, LARGEST_LATENT), LATENT_SIZE)
        p = g("Add", g("Sub", 1.0, g("Abs", l0)), g("Mul", l1, _FINE_STEP))
        t = g("Mul", g("Log", p), g("Neg", g("Sign", l0)))
        floor, inside = place(g, t, _ENERGY_KNOTS / _ENERGY_REACH)
        cell = g("Cast", g("Add", floor, float(_ENERGY_KNOTS)), to=TensorProto.INT32)
        start, slope = columns(g, g("Gather", interpolation_cells(g, self.energy), cell), 2)
        energy = kinetic_energy(g, g("Add", start, g("Mul", inside, slope)), self.energy_range)
        row, a = place(g, g("Clip", t, -_ROW_LIMIT, _ROW_LIMIT), _ROWS / _ROW_REACH)
        tail = g("Sub", 1.0, g("Abs", l2))
        logit_level = g("Mul", g("Log", g("Div", g("Sub", 2.0, tail), tail)), g("Sign", l2))
        column, b = place(g, logit_level, _COLUMNS / _COLUMN_REACH)
        width = 2 * _COLUMNS
        offset = float(_ROWS * width + _COLUMNS)
        cell = g("Cast", g("Add", g("Mul", row, float(width)), g("Add", column, offset)), to=TensorProto.INT32)
        coefficients = columns(g, g("Gather", bilinear_cells(g, self.zenith, self.charge), cell), 8)
        logit, threshold = (on_plane(g, coefficients[k : k + 4], a, b) for k in (0, 4))
        turn = l3 if self.azimuth is None else azimuth_turn_graph(g, self.azimuth, t, logit_level, l3)
        direction = _direction(g, logit, turn)
        return g, energy, direction, charge_sign(g, l4, threshold)


_ROW_LIMIT = _ROW_REACH * (1 - 1e-4)  # inside the last cell


def tabulate(generator: QuantileGenerator) -> QuantileTables:
    """Evaluate a generator's networks on the tables' knots.

    Raises
    ------
    FailedError
        If a map is not monotone in its latent.
    """
    with torch.no_grad():
        t = torch.linspace(-_ENERGY_REACH, _ENERGY_REACH, 2 * _ENERGY_KNOTS + 1, dtype=torch.float64)
        generator = copy.deepcopy(generator).double()
        energy = generator.pre_tanh(_logit_of_tail(t)) + generator.transform.mean
        rows = torch.linspace(-_ROW_REACH, _ROW_REACH, 2 * _ROWS + 1, dtype=torch.float64)
        columns = torch.linspace(-_COLUMN_REACH, _COLUMN_REACH, 2 * _COLUMNS + 1, dtype=torch.float64)
        y = generator.pre_tanh(_logit_of_tail(rows))
        zenith = generator.cos_zenith_logit(columns.expand(len(rows), -1), y)
        positive = generator.charge(y.repeat_interleave(len(columns)), torch.sigmoid(zenith).flatten())
        charge = torch.tanh(positive / 2).reshape(zenith.shape)
        azimuth = _azimuth(generator)
    for name, values in (("energy", energy), ("zenith", zenith)):
        if not (values.diff(dim=-1) >= 0).all():  # nor where one is no number
            raise FailedError(f"the {name} map decreases somewhere: its latent must raise it everywhere")
    return QuantileTables(
        energy=energy.float().numpy(),
        zenith=zenith.float().numpy(),
        charge=charge.float().numpy(),
        energy_range=(generator.tails.energy_min, generator.tails.energy_max),
        energy_mean=generator.transform.mean,
        azimuth=azimuth,
    )


def _azimuth(generator: QuantileGenerator) -> Float32 | None:
    """Evaluate the azimuth's network on its table's knots."""
    if generator.azimuth is None:
        return None
    y = generator.pre_tanh(_logit_of_tail(TAIL_KNOTS))
    cos_zenith = torch.sigmoid(generator.cos_zenith_logit(LEVEL_KNOTS.expand(len(y), -1), y))
    cumulative = generator.azimuth.cumulative(y.repeat_interleave(len(LEVEL_KNOTS)), cos_zenith.flatten())
    return (2 * cumulative - 1).float().reshape(len(TAIL_KNOTS), len(LEVEL_KNOTS), -1).numpy()


@dataclass(frozen=True)
class TableError:
    """How far tables are from the networks they were made of, root mean square and largest.

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
            f"The tables differ from the networks by {self.energy:.1e} of the energy (rms; at most "
            f"{self.largest_energy:.1e}) and {self.cos_zenith:.1e} in cos zenith "
            f"(at most {self.largest_cos_zenith:.1e})."
        )


def table_error(generator: QuantileGenerator, tables: QuantileTables, *, seed: int, muons: int = 100_000) -> TableError:
    """Compare tables with networks on random latents."""
    latent = 2 * torch.rand(muons, LATENT_SIZE, generator=torch.Generator().manual_seed(seed), dtype=torch.float64) - 1
    with torch.no_grad():
        found_energy, direction, _ = tables(latent)
        tail = 1 - latent[:, 0].abs() + _FINE_STEP * latent[:, 1]
        double = copy.deepcopy(generator).double()
        y = double.pre_tanh(torch.sign(latent[:, 0]) * torch.log((2 - tail) / tail))
        level = torch.logit((1 + latent[:, 2:3]) / 2)
        cos_zenith = torch.sigmoid(double.cos_zenith_logit(level, y))[:, 0]
    energy = (found_energy / generator.transform.energy(y) - 1).abs()
    angle = (-direction[:, 2] - cos_zenith).abs()
    return TableError(_rms(energy), float(energy.max()), _rms(angle), float(angle.max()))


def _rms(values: torch.Tensor) -> float:
    return float((values**2).mean().sqrt())


def _logit_of_tail(t: torch.Tensor) -> torch.Tensor:
    """Logit of the level whose tail probability is exp(-|t|) / 2 on the side of t's sign."""
    return torch.sign(t) * torch.log(2 * torch.exp(t.abs()) - 1)


def _direction(g: Graph, logit: str, turn: str) -> str:
    """Return unit vectors [n, 3]; 1 - cos zenith comes from the odds, without a cancellation near the vertical."""
    odds = g("Exp", g("Neg", logit))
    cos_zenith = g("Reciprocal", g("Add", odds, 1.0))
    sine = g("Sqrt", g("Mul", g("Mul", odds, cos_zenith), g("Add", cos_zenith, 1.0)))
    azimuth = g("Mul", turn, float(np.pi))
    return matrix(g, g("Mul", sine, g("Cos", azimuth)), g("Mul", sine, g("Sin", azimuth)), g("Neg", cos_zenith))
