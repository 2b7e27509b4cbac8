"""Tables in NumPy's format NPY."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_training.data.foreign.table import Float, Place, Table, numbered

__all__ = ["open_npy"]

PIECE = 1 << 20  # rows read at once


def open_npy(path: str | Path) -> Table:
    """Open a table in NPY.

    Raises
    ------
    RefusedError
        If the file can't be read, is no table of floating-point numbers, or has no row.
    """
    try:
        table = np.lib.format.open_memmap(path, mode="r")
    except (OSError, ValueError, TypeError) as error:
        raise RefusedError(f"{path} can't be read as an NPY file: {reason(error)}") from error
    if table.ndim != 2 or table.dtype.kind != "f":
        raise RefusedError(
            f"{path} has the shape {table.shape} and the type {table.dtype}: expected were floating-point numbers of "
            "the shape (number of muons, number of columns)"
        )
    if not len(table):
        raise RefusedError(f"{path} has no row")

    def rows(wanted: Sequence[int]) -> Iterator[tuple[Place, Float]]:
        for first in range(0, len(table), PIECE):
            piece = table[first : first + PIECE, list(wanted)]
            yield numbered(path, "row", first), piece.astype(np.float64)

    return Table(path, table.shape[1], rows)
