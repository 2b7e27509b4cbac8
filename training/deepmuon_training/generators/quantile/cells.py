"""Where the knots and the cells of the `quantile` generator's tables lie.

The file holds coarse tables. What a muon reads are large tables that are made of them once, when the file is loaded:
for each cell of a map a start and a slope, so that a number is start + place x slope. A cell's number is its place
without the fraction, which is the cheapest of all roundings.

Energy
    The place is t x 64, t being the logit of the level, from -34 to 34. The cells of positive places are numbered
    from 0, those of negative ones backward from the table's end, -1, -2, ...; cell 0 is twice as wide.
Zenith
    The place is C sqrt(v / (1 + 2 h) / 2), with v = 1 - l2 and h = sqrt(1 + l2): C = 544 at the horizon, 0 at the
    vertical. There v is exact and the place goes with its root, which is an angle: nothing cancels, and a direction has
    all its digits. At the horizon it goes with h, three times as fast as at the vertical, since cos zenith goes there
    with a root of the level. It takes square roots only: arc cosine or logarithm cost several times as much in some
    runtimes.
Row
    The zenith's map is a table for each of 65 energies, its rows. A cell of energy reads one of the two rows beside
    it; which one alternates from cell to cell, by ordered dithering, in shares that its distance from both
    asks for: the muons of sixteen neighbouring cells, 1/4 of t, are a mixture that has the distribution between the
    rows. Interpolation would read twice as much.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

__all__ = [
    "COLUMNS",
    "COLUMN_REACH",
    "ENERGY_CELLS",
    "ENERGY_PER_UNIT",
    "FINE_STEP",
    "HORIZON_WEIGHT",
    "KNOTS_PER_UNIT",
    "ROWS",
    "ROW_OF_CELL",
    "ZENITH_CELLS",
    "column_logits",
    "energy_logit",
    "energy_logits",
    "row_logits",
    "row_place",
    "zenith_square",
]

FINE_STEP = 2.0**-24
"""The energy's second latent counts in these units: it fills the gaps of the first."""

_REACH = 34  # log(2^49), t of the tail probability 2^-48 of a half, is 33.96

KNOTS_PER_UNIT = 32
"""Of the coarse table of energy, to a unit of t."""

ENERGY_PER_UNIT = 2 * KNOTS_PER_UNIT
"""Cells of energy, to a unit of t."""

ENERGY_CELLS = _REACH * ENERGY_PER_UNIT
"""Cells of energy on each side."""

ROWS = 65
_ROW_REACH = 10.75  # t where the zenith's condition stops changing: tail probability 2e-5
_ROW_BEND = 3.0  # rows are even in t below it, and in log t beyond: there are few muons, and they change slowly

COLUMNS = 129
COLUMN_REACH = 17.5
"""Logit of the outermost level of zenith in the coarse tables: log(2^25 - 1) = 17.3."""

ZENITH_CELLS = 544
"""Cells of zenith in each row."""

HORIZON_WEIGHT = 2.0
"""Of h in the place of zenith: the share of cells near the horizon grows with it."""

_DITHER_BITS = 4


def energy_logit(l0: torch.Tensor, l1: torch.Tensor) -> torch.Tensor:
    """Return the logit t of the energy's level for its two latents, clamped before.

    p = (1 - abs(l0)) + 2^-24 l1 is the tail probability on the side of l0, twice that of the whole. Counting it from
    both ends, p and 2 - p to a part in 2^24, keeps the digits of the nearer one without asking for the side.
    """
    fine = FINE_STEP * l1
    return torch.log(((1 + l0) + fine) / ((1 - l0) + fine))


def zenith_square(l2: torch.Tensor) -> torch.Tensor:
    """Return the square of the place of zenith for its latent, clamped before."""
    return (1 - l2) / (2 / ZENITH_CELLS**2 * (1 + HORIZON_WEIGHT * torch.sqrt(1 + l2)))


def energy_logits() -> torch.Tensor:
    """Return t at the knots of the coarse table of energy, float64 [2177]."""
    return torch.linspace(-_REACH, _REACH, 2 * _REACH * KNOTS_PER_UNIT + 1, dtype=torch.float64)


def row_logits() -> torch.Tensor:
    """Return t of the rows, float64 [65]."""
    even = torch.linspace(-1, 1, ROWS, dtype=torch.float64)
    return _ROW_BEND * torch.sinh(even * np.arcsinh(_ROW_REACH / _ROW_BEND))


def column_logits() -> torch.Tensor:
    """Return the logits of the level of zenith at the columns of the coarse tables, float64 [129]."""
    return torch.linspace(-COLUMN_REACH, COLUMN_REACH, COLUMNS, dtype=torch.float64)


def row_place(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the place of each t among the rows, 0 to 64: a row's own is its number."""
    even = np.arcsinh(np.clip(t, -_ROW_REACH, _ROW_REACH) / _ROW_BEND) / np.arcsinh(_ROW_REACH / _ROW_BEND)
    place: NDArray[np.float64] = (even + 1) / 2 * (ROWS - 1)
    return place


def _row_of_cell() -> NDArray[np.int8]:
    """Choose the row of each cell of energy, in the order of their numbers: 0, 1, ..., ..., -2, -1."""
    cell = np.concatenate([np.arange(ENERGY_CELLS), np.arange(1 - ENERGY_CELLS, 0)])
    t = (cell + np.sign(cell) / 2) / ENERGY_PER_UNIT
    period = 1 << _DITHER_BITS
    reversed_bits = np.array([int(f"{k:0{_DITHER_BITS}b}"[::-1], 2) for k in range(period)])
    threshold = (reversed_bits[cell % period] + 0.5) / period
    row = np.floor(row_place(t) + threshold)
    rows: NDArray[np.int8] = np.clip(row, 0, ROWS - 1).astype(np.int8)
    return rows


ROW_OF_CELL = _row_of_cell()
"""The row that a cell of energy reads, int8 [4351]: of all models the same."""
