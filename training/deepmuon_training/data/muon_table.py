"""Tables of muons, one a row, as CSV or NumPy's NPY: what a column means is stated, never guessed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.muons import MU_MINUS, Muons
from deepmuon_training.data.foreign_muons import CHARGE_UNKNOWN, Place, foreign_muons, numbered, pdg_id_of
from deepmuon_training.data.number_lines import read_number_lines

__all__ = ["UNITS", "Columns", "read_csv", "read_npy"]

UNITS = {"MeV": 1e-3, "GeV": 1.0}
"""GeV in each unit of energy."""

PIECE = 1 << 20  # rows of an NPY file that are read at once

SQUARE_TOLERANCE = 1e-5
"""By how much u^2 + v^2 of a level muon may be above 1, by rounding."""

SMALLEST_COSINE = 1e-4
"""Cosine of the zenith angle of a muon whose u and v, as they are rounded, leave nothing for w."""

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Columns:
    """What the columns of a table mean.

    Parameters
    ----------
    names : sequence of str
        For each column E (kinetic energy), u, v, w (direction of motion, z up), charge (-1, +1), pdg_id (13, -13) or
        skip. With -u, -v, -w the column holds the opposite: -w in a table whose z axis points down. E, u and v must be
        there. Without w it is the negative root of 1 - u^2 - v^2: muons go down.
    unit : str
        Unit of the energy, one of `UNITS`.

    Raises
    ------
    RefusedError
        If a name is none of these or there twice, or one is missing.
    """

    names: Sequence[str]
    unit: str

    KNOWN = ("E", "u", "v", "w", "-u", "-v", "-w", "charge", "pdg_id", "skip")

    def __post_init__(self) -> None:
        """Refuse what is no table of muons."""
        for name in self.names:
            if name not in self.KNOWN:
                raise RefusedError(f"there is no column {name!r}: a column is one of {', '.join(self.KNOWN)}")
        quantities = [name.lstrip("-") for name in self.names if name != "skip"]
        for name in quantities:
            if quantities.count(name) > 1:
                raise RefusedError(f"the column {name} is there twice")
        missing = [name for name in ("E", "u", "v") if name not in quantities]
        if missing:
            raise RefusedError(f"there is no column {' and '.join(missing)}: a muon needs E, u and v at least")
        if {"charge", "pdg_id"} <= set(quantities):
            raise RefusedError("the columns charge and pdg_id say the same: skip one of them")
        if self.unit not in UNITS:
            raise RefusedError(f"there is no unit {self.unit!r}: energies are in {' or '.join(UNITS)}")

    @property
    def has_charge(self) -> bool:
        """Whether a column says it."""
        return not {"charge", "pdg_id"}.isdisjoint(self.names)

    def __len__(self) -> int:
        """Return the number of columns."""
        return len(self.names)

    def __str__(self) -> str:
        """Return the names, with the unit."""
        return ", ".join(f"E [{self.unit}]" if name == "E" else name for name in self.names)

    def muons(self, numbers: Float, place: Place) -> Muons:
        """Make muons of rows; their pdg_id is 0 if no column has the charge.

        Parameters
        ----------
        numbers : float64 [n, columns]
            The rows.
        place
            As for `deepmuon_training.data.foreign_muons.foreign_muons`.

        Raises
        ------
        RefusedError
            If one can't be a muon.
        """
        u, v = self._component("u", numbers), self._component("v", numbers)
        has_w = not {"w", "-w"}.isdisjoint(self.names)
        w = self._component("w", numbers) if has_w else _downward(u, v, place)
        energy = UNITS[self.unit] * numbers[:, self.names.index("E")]
        return foreign_muons(energy, np.stack([u, v, w], axis=1), self._pdg_id(numbers, place), place)

    def _component(self, name: str, numbers: Float) -> Float:
        is_opposite = name not in self.names
        column = numbers[:, self.names.index(f"-{name}" if is_opposite else name)]
        return -column if is_opposite else column

    def _pdg_id(self, numbers: Float, place: Place) -> NDArray[np.int8] | int:
        if "charge" in self.names:
            return pdg_id_of(numbers[:, self.names.index("charge")], place)
        if "pdg_id" in self.names:
            return pdg_id_of(-numbers[:, self.names.index("pdg_id")] / MU_MINUS, place)
        return CHARGE_UNKNOWN


def _downward(u: Float, v: Float, place: Place) -> Float:
    """Return the w of unit vectors that go down."""
    with np.errstate(over="ignore"):
        square = u**2 + v**2
    if (square > 1 + SQUARE_TOLERANCE).any():
        row = int(np.argmax(square > 1 + SQUARE_TOLERANCE))
        raise RefusedError(f"{place(row)} has u^2 + v^2 = {square[row]:g}, and a direction has 1 at most")
    w: Float = -np.sqrt(np.maximum(1 - square, SMALLEST_COSINE**2))
    return w


def read_csv(path: str | Path, columns: Columns) -> Muons:
    """Read a table from text, in pieces: numbers with commas, or else blanks or tabs, between them.

    Lines at the top that start with # or hold no number are a header, and are not read.

    Raises
    ------
    RefusedError
        If the file can't be read, has no row, or a line that is no muon.
    """
    pieces = read_number_lines(path, len(columns))
    return Muons.concatenate([columns.muons(numbers, numbered(path, "line", first)) for first, numbers in pieces])


def read_npy(path: str | Path, columns: Columns) -> Muons:
    """Read a table from NumPy's format, in pieces.

    Raises
    ------
    RefusedError
        If the file can't be read, is no table of floating-point numbers with these columns, has no row, or a row that
        is no muon.
    """
    try:
        table = np.lib.format.open_memmap(path, mode="r")
    except (OSError, ValueError, TypeError) as error:
        raise RefusedError(f"{path} can't be read as an NPY file: {reason(error)}") from error
    if table.ndim != 2 or table.shape[1] != len(columns) or table.dtype.kind != "f":
        raise RefusedError(
            f"{path} has the shape {table.shape} and the type {table.dtype}: expected were floating-point numbers of "
            f"the shape (number of muons, {len(columns)})"
        )
    if not len(table):
        raise RefusedError(f"{path} has no row")
    firsts = range(0, len(table), PIECE)
    return Muons.concatenate(
        [columns.muons(table[i : i + PIECE].astype(np.float64), numbered(path, "row", i)) for i in firsts]
    )
