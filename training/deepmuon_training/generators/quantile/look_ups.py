"""The large tables that a `quantile` generator's muons are read from, made of the coarse ones: in PyTorch, and in ONNX.

Everything here depends on constants alone: runtimes compute it once, while they load the graph. Energies go from
knot to knot of the coarse table linearly in ln E. Columns of zenith go from one to the next along the cubic through
four of them (E. Catmull and R. Rom, 1974) in the logits of cos zenith and level: a straight line would let the density
jump at each column, by some per cent. The charge goes along straight lines, and stays between -1 and 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from onnx import TensorProto

from deepmuon_training.export.graph import Graph
from deepmuon_training.export.graph_steps import END, cut
from deepmuon_training.generators.quantile.cells import (
    COLUMN_REACH,
    COLUMNS,
    ENERGY_CELLS,
    HORIZON_WEIGHT,
    ROW_OF_CELL,
    ROWS,
    ZENITH_CELLS,
)

__all__ = ["LookUps", "LookUpsInGraph", "look_ups", "look_ups_graph"]

_PER_COLUMN = (COLUMNS - 1) / (2 * COLUMN_REACH)

_BENT_CELLS = 720
"""Cells of energy on each side, beyond which all read the outermost row."""

_NEAREST_LEVEL = 2.0**-25
"""No level of zenith is nearer to 0 or 1."""


@dataclass(frozen=True)
class LookUps:
    """What one cell gives, for all of them.

    Parameters
    ----------
    energy_start, energy_slope : [4351]
        GeV, and GeV to a cell.
    row : int64 [4351]
        Number of its first cell of zenith.
    versine_start, versine_slope : [65 x 544]
        1 - cos zenith, which has all its digits near the vertical, and to a unit of the place squared.
    charge : [65 x 544]
        2 P(mu+) - 1.
    """

    energy_start: torch.Tensor
    energy_slope: torch.Tensor
    row: torch.Tensor
    versine_start: torch.Tensor
    versine_slope: torch.Tensor
    charge: torch.Tensor


def look_ups(energy: torch.Tensor, zenith: torch.Tensor, charge: torch.Tensor) -> LookUps:
    """Evaluate in PyTorch, in the tables' precision.

    Parameters
    ----------
    energy : [2177]
        ln E/GeV over t.
    zenith, charge : [65, 129]
        Logit cos zenith and 2 P(mu+) - 1, for the rows of t over the logit of the level.
    """
    halves = torch.stack([energy[:-1], (energy[:-1] + energy[1:]) / 2], dim=1).flatten()
    knots = torch.exp(torch.cat([halves, energy[-1:]]))
    cell = torch.cat([torch.arange(ENERGY_CELLS), torch.arange(1 - ENERGY_CELLS, 0)])
    low, high = cell - (cell <= 0).long(), cell + (cell >= 0).long()
    energy_slope = (knots[high + ENERGY_CELLS] - knots[low + ENERGY_CELLS]) / (high - low)
    number = torch.arange(ZENITH_CELLS + 1, dtype=energy.dtype)
    column = _level_logit(number) * _PER_COLUMN + COLUMNS // 2  # inside: the nearest level is
    distance = column - torch.arange(-1, COLUMNS + 1, dtype=energy.dtype).unsqueeze(1)
    ends = 2 * zenith[:, :1] - zenith[:, 1:2], 2 * zenith[:, -1:] - zenith[:, -2:-1]
    versine = 1 / (1 + torch.exp(torch.cat([ends[0], zenith, ends[1]], dim=1) @ _cubic(distance.abs())))
    threshold = charge @ (1 - distance[1:-1].abs()).clamp(min=0)
    square = number**2
    versine_slope = versine.diff(dim=1) / square.diff()
    return LookUps(
        energy_start=knots[low + ENERGY_CELLS] - low * energy_slope,
        energy_slope=energy_slope,
        row=torch.from_numpy(ROW_OF_CELL).long() * ZENITH_CELLS,
        versine_start=(versine[:, :-1] - square[:-1] * versine_slope).flatten(),
        versine_slope=versine_slope.flatten(),
        charge=((threshold[:, :-1] + threshold[:, 1:]) / 2).flatten(),
    )


def _cubic(distance: torch.Tensor) -> torch.Tensor:
    """Return the weight of a column at a distance of so many columns."""
    near, far = (1 - distance).clamp(min=0), (2 - distance).clamp(min=0)
    return far**2 * (1 - distance) / 2 + near**2 * (2 * distance - 1)


def _level_logit(place: torch.Tensor) -> torch.Tensor:
    """Return the logit of the level at places of zenith, between those of 2^-25 and 1 - 2^-25.

    With x = (place / C)^2 and the level h^2 / 2: h^2 + 4 x h = 2 - 2 x. Nothing cancels in this root of it, nor in
    1 - level = x (1 + 2 h).
    """
    x = (place / ZENITH_CELLS) ** 2
    inhomogeneous = 2 - 2 * x
    linear = HORIZON_WEIGHT * x
    h = inhomogeneous / (linear + torch.sqrt(linear**2 + inhomogeneous))
    upper, lower = x * (1 + HORIZON_WEIGHT * h), h**2 / 2
    return torch.log(lower.clamp(min=_NEAREST_LEVEL) / upper.clamp(min=_NEAREST_LEVEL))


@dataclass(frozen=True)
class LookUpsInGraph:
    """The names of the same in a graph; rows are int32."""

    energy_start: str
    energy_slope: str
    row: str
    versine_start: str
    versine_slope: str
    charge: str


def look_ups_graph(g: Graph, energy: str, zenith: str, charge: str) -> LookUpsInGraph:
    """Build the same in ONNX, from the names of the coarse tables: constants, or what is computed of constants."""
    with g.scope("energy/cells"):
        energy_start, energy_slope = _energy_cells(g, energy)
    with g.scope("zenith/cells"):
        first = _first_cells(g)
        number = g("Range", 0.0, float(ZENITH_CELLS + 1), 1.0)
        distance = _column_distance(g, number)
        logit = g("MatMul", _continued(g, zenith), _cubic_graph(g, distance))
        # Some runtimes' Sigmoid is near 0 right to 1e-7 only, which is 4e-4 rad.
        versine = g("Reciprocal", g("Add", g("Exp", logit), 1.0))
        square = g("Mul", number, number)
        low, start = cut(g, square, 0, 0, -1), cut(g, versine, 1, 0, -1)
        rise = g("Sub", cut(g, versine, 1, 1, END), start)
        slope = g("Div", rise, g("Sub", cut(g, square, 0, 1, END), low))
        start = g("Sub", start, g("Mul", low, slope))
    with g.scope("charge/cells"):
        straight = g("Relu", g("Sub", 1.0, cut(g, distance, 0, 1, -1)))
        threshold = g("MatMul", charge, straight)
        both = g("Add", cut(g, threshold, 1, 0, -1), cut(g, threshold, 1, 1, END))
        middle = g("Mul", both, 0.5)
        return LookUpsInGraph(
            energy_start, energy_slope, first, *(g("Reshape", table, _FLAT) for table in (start, slope, middle))
        )


_FLAT = np.array([-1], dtype=np.int64)


def _int32(number: int) -> NDArray[np.int32]:
    return np.array(number, dtype=np.int32)


def _first_cells(g: Graph) -> str:
    """Return the number of the first cell of zenith in the row of each cell of energy; the file holds a part."""
    above, below = ROW_OF_CELL[:_BENT_CELLS], ROW_OF_CELL[-_BENT_CELLS:]
    stored = g("Cast", g.constant(np.concatenate([above, below]), "zenith/rows"), to=TensorProto.INT32)
    beyond = np.array([ENERGY_CELLS - _BENT_CELLS], dtype=np.int64), np.array([ENERGY_CELLS - 1 - _BENT_CELLS])
    highest, lowest = (g("Expand", _int32(row), size) for row, size in zip((ROWS - 1, 0), beyond, strict=True))
    parts = cut(g, stored, 0, 0, _BENT_CELLS), highest, lowest, cut(g, stored, 0, _BENT_CELLS, END)
    return g("Mul", g("Concat", *parts, axis=0), _int32(ZENITH_CELLS))


def _energy_cells(g: Graph, table: str) -> tuple[str, str]:
    """Return start and slope of the cells of energy."""
    low, high = cut(g, table, 0, 0, -1), cut(g, table, 0, 1, END)
    column = np.array([-1, 1], dtype=np.int64)
    halves = g("Concat", *(g("Reshape", x, column) for x in (low, g("Mul", g("Add", low, high), 0.5))), axis=1)
    knots = g("Exp", g("Concat", g("Reshape", halves, _FLAT), cut(g, table, 0, -1, END), axis=0))
    number = g("Range", -float(ENERGY_CELLS), float(ENERGY_CELLS + 1), 1.0)
    (low_number, high_number), (low, high) = (_cell_ends(g, values) for values in (number, knots))
    slope = g("Div", g("Sub", high, low), g("Sub", high_number, low_number))
    return g("Sub", low, g("Mul", low_number, slope)), slope


def _cell_ends(g: Graph, knots: str) -> tuple[str, str]:
    """Return the lower and the upper end of each cell of energy, in the order 0, 1, ..., ..., -2, -1."""
    zero = ENERGY_CELLS  # number of the knot at t = 0
    middle, above = cut(g, knots, 0, zero - 1, zero), cut(g, knots, 0, zero + 1, -1)
    low = g("Concat", middle, above, cut(g, knots, 0, 0, zero - 1), axis=0)
    return low, g("Concat", cut(g, knots, 0, zero + 1, END), cut(g, knots, 0, 1, zero), axis=0)


def _column_distance(g: Graph, place: str) -> str:
    """Return how many columns places are from each column, and from one more on both sides: [columns + 2, places]."""
    part = g("Mul", place, 1 / ZENITH_CELLS)
    x = g("Mul", part, part)
    inhomogeneous = g("Sub", 2.0, g("Mul", x, 2.0))
    linear = g("Mul", x, HORIZON_WEIGHT)
    h = g("Div", inhomogeneous, g("Add", linear, g("Sqrt", g("Add", g("Mul", linear, linear), inhomogeneous))))
    upper = g("Max", g("Mul", x, g("Add", g("Mul", h, HORIZON_WEIGHT), 1.0)), _NEAREST_LEVEL)
    lower = g("Max", g("Mul", g("Mul", h, h), 0.5), _NEAREST_LEVEL)
    logit = g("Log", g("Div", lower, upper))
    beyond = float(COLUMNS // 2 + 1)
    columns = g("Reshape", g("Range", -beyond, beyond + 1, 1.0), np.array([-1, 1], dtype=np.int64))
    return g("Abs", g("Sub", g("Mul", logit, _PER_COLUMN), columns))


def _continued(g: Graph, table: str) -> str:
    """Continue a table by one column on both sides, in straight lines."""
    left, right = (
        g("Sub", g("Mul", cut(g, table, 1, end, after), 2.0), cut(g, table, 1, inner, next_after))
        for end, after, inner, next_after in ((0, 1, 1, 2), (-1, END, -2, -1))
    )
    return g("Concat", left, table, right, axis=1)


def _cubic_graph(g: Graph, distance: str) -> str:
    """Build the weights of `_cubic`."""
    near, far = (g("Relu", g("Sub", reach, distance)) for reach in (1.0, 2.0))
    outer = g("Mul", g("Mul", far, far), g("Mul", g("Sub", 1.0, distance), 0.5))
    return g("Add", outer, g("Mul", g("Mul", near, near), g("Sub", g("Mul", distance, 2.0), 1.0)))
