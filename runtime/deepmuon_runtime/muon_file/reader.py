"""Muons and what is said of them, out of a muon file: the one door for all who read one.

A file may be a stranger's, or damaged: what `deepmuon-check` would call a defect of the format is refused here too.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import h5py
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.muon_file.attributes import ALWAYS, checksum_defects, value_defects
from deepmuon_runtime.muon_file.checksum import crc32, unlike
from deepmuon_runtime.muon_file.columns import (
    columns_of,
    missing_columns,
    statement_defects,
    storage_defects,
    type_defects,
)
from deepmuon_runtime.muon_file.damage import READ_ERRORS, member
from deepmuon_runtime.muon_file.format import (
    ATTRIBUTES_CHECKSUM,
    CHECKSUM,
    COLUMNS,
    bytes_per_muon,
    check_format,
    stated,
)
from deepmuon_runtime.muon_file.virtual import VirtualColumn
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.room import check_memory

__all__ = ["OpenedMuons", "opened", "opened_file", "read_attributes", "read_muons", "read_pieces", "verify_muons"]

PIECE = 1 << 17  # muons read at once


def read_muons(path: str | Path, first: int = 0, count: int | None = None) -> Muons:
    """Read muons from a file.

    All muons of a file must be those that were written, by the checksums of their columns. A part of them can't be
    verified: `deepmuon-check` does that once for the file.

    Parameters
    ----------
    path
        A muon file.
    first
        Position of the first muon wanted, from 0.
    count
        How many; all that follow `first` if left out.

    Returns
    -------
    Muons [count], with places and times where the file has them.

    Raises
    ------
    RefusedError
        If the file can't be read, is no muon file or a damaged one, or does not hold the muons asked for, or the
        memory does not hold them.
    """
    with opened(path) as file:
        total = len(file)
        end = total if count is None else first + count
        if not 0 <= first <= end <= total:
            raise RefusedError(f"{path} holds {total} muons: those from {first} to {end} can't be read")
        size = (end - first) * bytes_per_muon(file.columns)
        check_memory(size, f"{end - first:,} muons of {path}", "read them in parts")
        columns = file.read(first, end, file.columns)
        if (first, end) == (0, total):
            for name, column in columns.items():
                file.verify(name, crc32(column.data))
        return Muons(**columns)


def read_pieces(path: str | Path, size: int) -> Iterator[Muons]:
    """Read all muons of a file, piece by piece, and verify them by the checksums of their columns.

    Parameters
    ----------
    path
        A muon file.
    size
        How many muons of it are in memory at once.

    Yields
    ------
    Muons [size], and fewer at the end, with places and times where the file has them.

    Raises
    ------
    RefusedError
        If the file can't be read or is no muon file; after the last piece, if they are not what was written: whoever
        makes something of them should not let it be seen before the end.
    """
    with opened(path) as file:
        for columns in file.pieces(size, file.columns):
            yield Muons(**columns)


def verify_muons(path: str | Path, progress: Callable[[int], object] = lambda _: None) -> None:
    """Read a whole file, and compare it with its checksums.

    Parameters
    ----------
    path
        A muon file.
    progress
        Called again and again with the number of muons read since the last call.

    Raises
    ------
    RefusedError
        If the file can't be read, is no muon file, or is not what was written.
    """
    with opened(path) as file:
        for columns in file.pieces(PIECE, file.columns):
            progress(len(columns["pdg_id"]))


def read_attributes(path: str | Path) -> dict[str, Any]:
    """Read what a file says of its muons.

    Parameters
    ----------
    path
        A muon file.

    Returns
    -------
    All attributes of `/muons`, but for their checksum, as Python's str, int, float, bool, and lists of them. Those of
    the format are what they can be.

    Raises
    ------
    RefusedError
        If the file can't be read, is no muon file, or its attributes are not what was written.
    """
    with opened(path) as file:
        return file.attributes


class OpenedMuons:
    """A muon file that keeps the format, open for reading.

    Parameters
    ----------
    file
        Any HDF5 file.
    path
        Its name, for errors.

    Attributes
    ----------
    attributes : dict
        As `read_attributes` gives them.
    columns : dict
        What holds each column by its name, optional ones included.
    checksums : dict of int
        The CRC-32 that each column says it has.

    Raises
    ------
    RefusedError
        If it is no muon file, or has a defect that can be found without reading the muons.
    """

    def __init__(self, file: h5py.File, path: str | Path) -> None:
        self._path = path
        version = check_format(file, path)
        group = member(file, "muons")
        if not isinstance(group, h5py.Group):
            raise RefusedError(f"{path} has no group /muons")
        self.attributes = self._stated(group, version)
        self.columns: dict[str, h5py.Dataset | VirtualColumn] = {}
        self.checksums: dict[str, int] = {}
        columns = columns_of(group, version)
        for name in missing_columns(group, columns, version):
            raise RefusedError(f"{path} lacks the column {name}")
        for name, column in columns.items():
            self._add(name, column)

    def __len__(self) -> int:
        """Return the number of muons."""
        return len(self.columns["pdg_id"])

    def read(self, first: int, end: int, names: Collection[str] = tuple(COLUMNS)) -> dict[str, NDArray[Any]]:
        """Return columns of the muons from `first` to `end` (without the end), not verified."""
        return {name: self.columns[name][first:end] for name in names}

    def pieces(self, size: int, names: Collection[str] = tuple(COLUMNS)) -> Iterator[dict[str, NDArray[Any]]]:
        """Yield columns of all muons, in pieces of a size; after the last, refuse what is not what was written."""
        found = dict.fromkeys(names, 0)
        for first in range(0, len(self), size):
            columns = self.read(first, min(first + size, len(self)), names)
            found = {name: crc32(column.data, found[name]) for name, column in columns.items()}
            yield columns
        for name, checksum in found.items():
            self.verify(name, checksum)

    def verify(self, name: str, checksum: int) -> None:
        """Raise RefusedError unless a column says that it has this checksum."""
        if checksum != self.checksums[name]:
            where = " (or one of its sources)" if isinstance(self.columns[name], VirtualColumn) else ""
            raise RefusedError(
                f"{self._path} is damaged: the column {name}{where} {unlike(checksum, self.checksums[name])}"
            )

    def _stated(self, group: h5py.Group, version: int) -> dict[str, Any]:
        attributes = stated(group)
        for defect in checksum_defects(attributes, version):
            raise RefusedError(f"{self._path} is damaged: {defect}")
        for name in ALWAYS:
            if name not in attributes:
                raise RefusedError(f"{self._path} lacks the attribute {name} of /muons")
        for defect in value_defects(attributes):
            raise RefusedError(f"{self._path}: {defect}")
        return {name: value for name, value in attributes.items() if name != ATTRIBUTES_CHECKSUM}

    def _add(self, name: str, column: h5py.Dataset) -> None:
        attributes = stated(column)
        defects = chain(
            type_defects(column, name),
            () if column.is_virtual else storage_defects(column),  # the sources are looked at when they are read
            statement_defects(column, attributes, name, self.attributes["count"]),
        )
        for defect in defects:
            raise RefusedError(f"{self._path}: the column {name} {defect}")
        self.columns[name] = VirtualColumn(column, name) if column.is_virtual else column
        self.checksums[name] = attributes[CHECKSUM]


@contextmanager
def opened_file(path: str | Path) -> Iterator[h5py.File]:
    """Open a file for reading, turning HDF5's errors into one line; what is no file, as a pipe, would be waited for."""
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise RefusedError(f"{path} can't be read as a muon file: it is a folder, a pipe or a device")
        with h5py.File(path, "r") as file:
            yield file
    except READ_ERRORS as error:
        raise RefusedError(f"{path} can't be read as a muon file: {_reason(path, error)}") from error


def _reason(path: str | Path, error: BaseException) -> str:
    """Return why a file can't be read; of one that is none of HDF5's, which command reads others."""
    if isinstance(error, OSError) and not error.errno and not h5py.is_hdf5(path):
        return (
            "it is no HDF5; deepmuon-convert makes that of MCPL, ROOT and text that DeepMuon wrote, and deepmuon-train "
            "convert of what others wrote"
        )
    return reason(error)


@contextmanager
def opened(path: str | Path) -> Iterator[OpenedMuons]:
    """Open a muon file that keeps the format; RefusedError if it does not, or can't be read."""
    with opened_file(path) as file:
        yield OpenedMuons(file, path)
