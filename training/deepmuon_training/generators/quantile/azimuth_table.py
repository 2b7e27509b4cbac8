"""The learned azimuth of a `quantile` generator as a table, and its evaluation, in PyTorch and in an ONNX graph.

The table holds the cumulative distribution of the azimuth, from -1 to 1, at 129 angles from -pi to pi, for 41
energies and 33 zenith angles. Between these the distributions are interpolated, so that a sector with few muons
stays one, which an interpolation of the angles would fill. The angle at which the distribution takes the value of
the latent is found by bisection. Both ends of the table are the same direction: the map is a circle's.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from onnx import TensorProto

from deepmuon_training.export.graph import Graph
from deepmuon_training.export.graph_steps import bilinear, bilinear_cells, locate, look_up, on_plane, place
from deepmuon_training.generators.quantile.azimuth_fit import AZIMUTH_BINS

__all__ = ["LEVEL_KNOTS", "TAIL_KNOTS", "azimuth_turn", "azimuth_turn_graph"]

_PER_UNIT = 2.0  # knots to a unit of either coordinate
_TAIL_REACH, _LEVEL_REACH = 10.0, 8.0
_INSIDE = 1 - 1e-4

TAIL_KNOTS = torch.linspace(-_TAIL_REACH, _TAIL_REACH, 41, dtype=torch.float64)
"""The table's energies: logit of the energy's level."""

LEVEL_KNOTS = torch.linspace(-_LEVEL_REACH, _LEVEL_REACH, 33, dtype=torch.float64)
"""Its zenith angles: logit of the zenith's level."""

_STEPS = [AZIMUTH_BINS >> k for k in range(1, AZIMUTH_BINS.bit_length())]  # 64, 32, ..., 1

Float32 = NDArray[np.float32]


def azimuth_turn(table: torch.Tensor, t: torch.Tensor, level: torch.Tensor, latent: torch.Tensor) -> torch.Tensor:
    """Return azimuth / pi [n] for latents [n] in (-1, 1).

    Parameters
    ----------
    table : [41, 33, 129]
        Twice the cumulative distribution, less 1.
    t, level : [n]
        Coordinates of energy and zenith.
    latent : [n]
        Uniform numbers.
    """
    i, a = locate(t.clamp(-_TAIL_REACH * _INSIDE, _TAIL_REACH * _INSIDE), _PER_UNIT)
    j, b = locate(level.clamp(-_LEVEL_REACH * _INSIDE, _LEVEL_REACH * _INSIDE), _PER_UNIT)
    i, j = i + len(TAIL_KNOTS) // 2, j + len(LEVEL_KNOTS) // 2
    k, below, above = torch.zeros_like(i), -torch.ones_like(latent), torch.ones_like(latent)
    for step in _STEPS:
        middle = bilinear(table, i, a, j, b, k + step)
        further = middle <= latent
        k = torch.where(further, k + step, k)
        below, above = torch.where(further, middle, below), torch.where(further, above, middle)
    return (k + (latent - below) / (above - below)) * (2 / AZIMUTH_BINS) - 1


def azimuth_turn_graph(g: Graph, table: Float32, t: str, level: str, latent: str) -> str:
    """Build the same in ONNX."""
    row, a = place(g, g("Clip", t, -_TAIL_REACH * _INSIDE, _TAIL_REACH * _INSIDE), _PER_UNIT)
    column, b = place(g, g("Clip", level, -_LEVEL_REACH * _INSIDE, _LEVEL_REACH * _INSIDE), _PER_UNIT)
    rows, cols, knots = table.shape
    offset = float(rows // 2 * (cols - 1) + cols // 2)
    node = g("Add", g("Mul", row, float(cols - 1)), g("Add", column, offset))
    k = g("Cast", g("Mul", node, float(knots)), to=TensorProto.INT32)  # exact: below 2^24
    first = k
    cells = bilinear_cells(g, table)
    below, above = g.constant(-1.0), g.constant(1.0)
    for step in _STEPS:
        next_k = g("Add", k, np.array(step, dtype=np.int32))
        middle = on_plane(g, [look_up(g, cell, next_k) for cell in cells], a, b)
        further = g("LessOrEqual", middle, latent)
        k = g("Where", further, next_k, k)
        below, above = g("Where", further, middle, below), g("Where", further, above, middle)
    inside = g("Div", g("Sub", latent, below), g("Sub", above, below))
    bin_number = g("Cast", g("Sub", k, first), to=TensorProto.FLOAT)
    return g("Sub", g("Mul", g("Add", bin_number, inside), 2 / AZIMUTH_BINS), 1.0)
