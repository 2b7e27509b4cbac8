"""Muons of a file, whatever its format: what it says of them, and their columns piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.format import COLUMNS, OPTIONAL_COLUMNS

__all__ = ["PIECE", "Columns", "Source", "column_types"]

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


def column_types(names: object, path: object) -> dict[str, np.dtype[Any]]:
    """Return the types of named columns in the order of a muon file; RefusedError unless they may be those of one."""
    every = {**COLUMNS, **OPTIONAL_COLUMNS}
    if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
        raise RefusedError(f"{path} does not say which columns it has")
    found = {name: dtype for name, (dtype, _) in every.items() if name in names}
    if len(found) != len(names) or not COLUMNS.keys() <= found.keys() or len(found.keys() & set("xyz")) not in (0, 3):
        raise RefusedError(f"{path} has the columns {', '.join(names)[:200]}, which are none of a muon file")
    return found
