"""Muons of a file, whatever its format: what it says of them, and their columns piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

__all__ = ["PIECE", "Columns", "Source"]

PIECE = 1 << 17
"""Muons that are in memory at once, about."""

Columns = Mapping[str, NDArray[Any]]
"""Columns of some muons by their names."""


@dataclass(frozen=True)
class Source:
    """An open file of muons.

    Parameters
    ----------
    attributes
        What the file says of its muons, as the attributes of a muon file (docs/hdf5_format.md).
    names
        Its columns.
    pieces
        Begins to read: columns of consecutive muons, about `PIECE` of them at once. After the last piece it raises
        RefusedError if they are not what was written.
    """

    attributes: dict[str, Any]
    names: tuple[str, ...]
    pieces: Callable[[], Iterator[Columns]]
