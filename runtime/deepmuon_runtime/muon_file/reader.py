"""Muons and what is said of them, out of a muon file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.muon_file.attributes import ALWAYS
from deepmuon_runtime.muon_file.damage import READ_ERRORS
from deepmuon_runtime.muon_file.format import CHECKSUM, COLUMNS, check_format, python_value
from deepmuon_runtime.muon_file.virtual import VirtualColumn
from deepmuon_runtime.muons import Muons

__all__ = ["checksums_of", "opened", "read_attributes", "read_checksums", "read_muons", "read_pieces"]


def read_muons(path: str | Path, first: int = 0, count: int | None = None) -> Muons:
    """Read muons from a file.

    Parameters
    ----------
    path
        A muon file, format version 1.
    first
        Position of the first muon wanted, from 0.
    count
        How many; all that follow `first` if left out.

    Returns
    -------
    Muons [count]

    Raises
    ------
    RefusedError
        If the file can't be read, is no muon file, or does not hold the muons asked for.
    """
    with opened(path) as group:
        total = len(group["kinetic_energy"])
        end = total if count is None else first + count
        if not 0 <= first <= end <= total:
            raise RefusedError(f"{path} holds {total} muons: those from {first} to {end} can't be read")
        return Muons(**{name: _readable(group[name])[first:end] for name in COLUMNS})


def read_pieces(path: str | Path, size: int) -> Iterator[Muons]:
    """Read all muons of a file, piece by piece.

    Parameters
    ----------
    path
        A muon file, format version 1.
    size
        How many muons of it are in memory at once.

    Yields
    ------
    Muons [size], and fewer at the end.

    Raises
    ------
    RefusedError
        If the file can't be read or is no muon file.
    """
    with opened(path) as group:
        columns = {name: _readable(group[name]) for name in COLUMNS}
        for first in range(0, len(group["pdg_id"]), size):
            yield Muons(**{name: column[first : first + size] for name, column in columns.items()})


def read_checksums(path: str | Path) -> dict[str, int]:
    """Read the CRC-32 of each column that a file says it has.

    Raises
    ------
    RefusedError
        If the file can't be read or is no muon file, or a column has none.
    """
    with opened(path) as group:
        return checksums_of(group)


def read_attributes(path: str | Path) -> dict[str, Any]:
    """Read what a file says of its muons.

    Parameters
    ----------
    path
        A muon file, format version 1.

    Returns
    -------
    All attributes of `/muons` as Python's str, int, float, bool, and lists of str.

    Raises
    ------
    RefusedError
        If the file can't be read or is no muon file.
    """
    with opened(path) as group:
        return {name: python_value(value) for name, value in group.attrs.items()}


@contextmanager
def opened(path: str | Path) -> Iterator[h5py.Group]:
    """Open the group `/muons` of a file that keeps the format, turning HDF5's errors into one line."""
    try:
        with h5py.File(path, "r") as file:
            yield _checked(file, path)
    except READ_ERRORS as error:
        raise RefusedError(f"{path} can't be read as a muon file: {reason(error)}") from error


def _readable(column: h5py.Dataset) -> h5py.Dataset | VirtualColumn:
    return VirtualColumn(column) if column.is_virtual else column


def checksums_of(group: h5py.Group) -> dict[str, int]:
    """Return the CRC-32 that each column of an opened file says it has."""
    return {name: int(group[name].attrs[CHECKSUM]) for name in COLUMNS}


def _checked(file: h5py.File, path: str | Path) -> h5py.Group:
    check_format(file, path)
    group = file.get("muons")
    if not isinstance(group, h5py.Group):
        raise RefusedError(f"{path} has no group /muons")
    for name in ALWAYS:
        if name not in group.attrs:
            raise RefusedError(f"{path} lacks the attribute {name} of /muons")
    count = group.attrs["count"]
    for name, (dtype, _) in COLUMNS.items():
        column = group.get(name)
        if not isinstance(column, h5py.Dataset) or column.dtype != dtype or column.shape != (count,):
            found = f"{column.dtype} {column.shape}" if isinstance(column, h5py.Dataset) else "none"
            raise RefusedError(f"{path}: the column {name} should be {dtype} of ({count},), and is {found}")
    return group
