"""Steps that the graphs of both architectures share."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from onnx import TensorProto

from deepmuon_training.energy_transform import LAMBDA, MEV_PER_GEV
from deepmuon_training.export.graph import Graph

__all__ = [
    "END",
    "LARGEST_LATENT",
    "bilinear",
    "bilinear_cells",
    "charge_sign",
    "columns",
    "cut",
    "interpolation_cells",
    "kinetic_energy",
    "linear",
    "locate",
    "look_up",
    "matrix",
    "on_plane",
    "place",
]

LARGEST_LATENT = 1 - 2**-24
"""Latents are clamped to this absolute value, the largest below 1 in float32."""

END = 2**31 - 1
"""Where a part of a table ends that goes on to the table's end."""

_FLAT = np.array([-1], dtype=np.int64)


def columns(g: Graph, matrix: str, count: int) -> list[str]:
    """Return the columns of an [n, count] matrix, each [n]; one-dimensional throughout, which runtimes do fastest."""
    flat = g("Reshape", g("Transpose", matrix, perm=[1, 0]), _FLAT)
    return g.several("Split", count, flat, axis=0, num_outputs=count)


def matrix(g: Graph, *values: str) -> str:
    """Return a matrix [n, count] with the given columns, each [n]."""
    rows = g("Reshape", g("Concat", *values, axis=0), np.array([len(values), -1], dtype=np.int64))
    return g("Transpose", rows, perm=[1, 0])


def look_up(g: Graph, table: str, index: str) -> str:
    """Return the numbers [n] of a table [m] at int32 indices [n], which may count from its end as -1, -2, ...

    Of data and indices of one dimension, GatherElements and Gather are the same operation. Processors do the first
    some ten times as fast, CUDA the second; a runtime may take the one for the other wherever a node's name has
    `/look_up/` in it, as it has within a scope.
    """
    with g.scope("look_up"):
        return g("GatherElements", table, index, axis=0)


def kinetic_energy(g: Graph, x: str, energy_range: tuple[float, float]) -> str:
    """Return (x^9 - 1) / 9 MeV in GeV, clipped to the range; Pow with exponent 9 would be slower."""
    x2 = g("Mul", x, x)
    x4 = g("Mul", x2, x2)
    x9 = g("Mul", g("Mul", x4, x4), x)
    energy = g("Mul", g("Sub", x9, 1.0), 1 / (LAMBDA * MEV_PER_GEV))
    return g("Clip", energy, *energy_range)


def place(g: Graph, value: str, scale: float) -> tuple[str, str]:
    """Return the cell of value x scale among the whole numbers, and the place in it, 0 to 1."""
    position = g("Mul", value, scale)
    floor = g("Floor", position)
    return floor, g("Sub", position, floor)


def interpolation_cells(g: Graph, table: NDArray[np.float32]) -> list[str]:
    """Return the start and the slope of each cell between a table's knots, each [knots - 1].

    Runtimes make them when they load the graph; the file holds the plain table.
    """
    name = g.constant(table.reshape(-1, 1))
    start = cut(g, name, 0, 0, -1)
    return [g("Reshape", part, _FLAT) for part in (start, g("Sub", cut(g, name, 0, 1, END), start))]


def bilinear_cells(g: Graph, table: NDArray[np.float32]) -> list[str]:
    """Return value, slope along columns, slope along rows and mixed term of each cell, each [cells].

    Further dimensions of a table are indices of its cells.
    """
    name = g.constant(table)
    corner = cut(g, name, 1, 0, -1)
    along = g("Sub", cut(g, name, 1, 1, END), corner)
    starts = [cut(g, part, 0, 0, -1) for part in (corner, along)]
    ends = [cut(g, part, 0, 1, END) for part in (corner, along)]
    slopes = [g("Sub", end, start) for start, end in zip(starts, ends, strict=True)]
    return [g("Reshape", part, _FLAT) for part in (*starts, *slopes)]


def on_plane(g: Graph, coefficients: list[str], a: str, b: str) -> str:
    """Return value + b along columns + a (along rows + b mixed)."""
    value, along_columns, along_rows, mixed = coefficients
    upper = g("Add", value, g("Mul", b, along_columns))
    return g("Add", upper, g("Mul", a, g("Add", along_rows, g("Mul", b, mixed))))


def bilinear(
    table: torch.Tensor, i: torch.Tensor, a: torch.Tensor, j: torch.Tensor, b: torch.Tensor, *k: torch.Tensor
) -> torch.Tensor:
    """Evaluate in PyTorch what `bilinear_cells` and `on_plane` do, in row cell i at a and column cell j at b.

    A table of more dimensions is read at the further indices k.
    """

    def along_columns(i: torch.Tensor) -> torch.Tensor:
        return table[(i, j, *k)] + b * (table[(i, j + 1, *k)] - table[(i, j, *k)])

    upper = along_columns(i)
    return upper + a * (along_columns(i + 1) - upper)


def locate(value: torch.Tensor, scale: float) -> tuple[torch.Tensor, torch.Tensor]:
    """Evaluate in PyTorch what `place` does; the cell is a whole number."""
    position = value * scale
    floor = torch.floor(position)
    return floor.long(), position - floor


def linear(table: torch.Tensor, cell: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
    """Evaluate in PyTorch what `interpolation_cells` is for."""
    return table[cell] + inside * (table[cell + 1] - table[cell])


def charge_sign(g: Graph, latent: str, threshold: str) -> str:
    """Return +1 where the latent is below its threshold 2 P(mu+) - 1, else -1: int8, cast last."""
    return g("Cast", g("Where", g("Less", latent, threshold), 1.0, -1.0), to=TensorProto.INT8)


def cut(g: Graph, table: str, axis: int, start: int, stop: int) -> str:
    """Return a table's part from start to before stop along an axis; numbers below 0 count from its end."""
    return g("Slice", table, *(np.array([k], dtype=np.int64) for k in (start, stop, axis)))
