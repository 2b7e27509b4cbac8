"""A table of another program, of whatever format: rows of numbers, and what its file says of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Float", "Place", "Table", "numbered"]

Float = NDArray[np.float64]

Place = Callable[[int], str]
"""Says where a row of some rows stands, given its position: "shower.out, line 7"."""


@dataclass(frozen=True)
class Table:
    """A table that was opened, and whose rows are not read yet.

    Parameters
    ----------
    path : str or Path
        The file.
    width : int
        How many columns it has.
    rows : callable
        Reads the columns at given positions, from 0, in pieces: where the rows stand, and float64 [rows, positions].
        It can be called once.
    headings : tuple of str
        The names of the columns; none where the file has none.
    notes : mapping
        What comments of `deepmuon-convert` say, by the names of a muon file's attributes.
    first_line : str
        Of a text, as it can be shown.
    """

    path: str | Path
    width: int
    rows: Callable[[Sequence[int]], Iterator[tuple[Place, Float]]]
    headings: tuple[str, ...] = ()
    notes: Mapping[str, Any] = field(default_factory=dict)
    first_line: str = ""


def numbered(path: str | Path, kind: str, first: int) -> Place:
    """Return the place of rows of which each is a line or row of a file, the first of them being number `first`."""
    return lambda index: f"{path}, {kind} {first + index}"
