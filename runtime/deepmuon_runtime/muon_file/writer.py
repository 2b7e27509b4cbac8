"""Writes muon files: complete under their name, or not there."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import NamedTuple

import h5py
import numpy as np
from numpy.typing import ArrayLike

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.files.early_flush import EarlyFlush
from deepmuon_runtime.files.partial import PartialFile
from deepmuon_runtime.files.quiet import QuietFile
from deepmuon_runtime.muon_file.attributes import Description
from deepmuon_runtime.muon_file.checksum import attributes_crc32, joined_crc32
from deepmuon_runtime.muon_file.format import (
    ATTRIBUTES_CHECKSUM,
    CHECKSUM,
    COLUMNS,
    FORMAT,
    FORMAT_VERSION,
    OPTIONAL_COLUMNS,
    bytes_per_muon,
    column_types,
    stated,
)
from deepmuon_runtime.muon_file.growing_column import GrowingColumn
from deepmuon_runtime.muon_file.output import check_muon_output
from deepmuon_runtime.muon_file.reader import opened
from deepmuon_runtime.muon_file.virtual import Source, VirtualColumn, create_virtual_column
from deepmuon_runtime.muons import Muons

__all__ = ["MuonWriter", "write_muons"]

LARGEST_CHUNK = 1 << 17  # muons of one HDF5 chunk: smaller ones cost time and memory, larger ones gain nothing
SMALLEST_CHUNK = 1 << 10  # but a file of a few muons should not carry a large empty chunk


class MuonWriter:
    """Writes a muon file piece by piece, and gives it its name only when it is complete.

    Use it in a `with` statement. If the body raises, or is interrupted, nothing is left behind.

    Parameters
    ----------
    path
        The file to be written; its folder must exist.
    attributes
        What the file says of its muons: `depth_m` and `medium` at least; strings, numbers, booleans, or lists
        of them. `count` and `created` are added, `created_by` unless given, and where a rate is above 0 the live time
        that it makes of the count (`live_time_s_m2 = count / rate_hz_per_m2`).
    overwrite
        Whether an existing file is replaced, at the moment when the new one is complete.
    optional
        Which of the optional columns (`format.OPTIONAL_COLUMNS`) the file has.

    Attributes
    ----------
    path : Path
        The absolute path of the file, links followed.
    count : int
        Muons written so far.

    Raises
    ------
    RefusedError
        On construction and entry, if `path` can't be written, an attribute is missing or can't be what it is, a file
        has no such optional columns, as x without y, or SOURCE_DATE_EPOCH is no time.
    FailedError
        Later, if writing fails (disk full), or another process has written `path` meanwhile.
    """

    # HDF5 calls back into Python (QuietFile), and must not meet a KeyboardInterrupt there. Python handles
    # signals in the main thread only, so all calls of HDF5 are made by a thread of their own.

    def __init__(
        self,
        path: str | Path,
        attributes: Mapping[str, object],
        overwrite: bool = False,
        *,
        optional: Collection[str] = (),
    ) -> None:
        check_muon_output(path, overwrite)
        self._partial = PartialFile(path, overwrite)
        self.path = self._partial.target
        self.count = 0
        self._description = Description(path, attributes)
        self._types = column_types([*COLUMNS, *optional], path)
        self._growing: dict[str, GrowingColumn] = {}
        self._columns: dict[str, h5py.Dataset] = {}  # complete ones, and their checksums
        self._checksums: dict[str, int] = {}

    def __enter__(self) -> MuonWriter:
        """Create the temporary file."""
        self._partial.begin()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="muon-writer")
        try:
            self._in_thread(self._open)
        except BaseException as error:
            self._discard()
            if isinstance(error, OSError):
                raise RefusedError(f"{self.path} can't be written: {reason(error)}") from error
            raise
        return self

    def append(self, muons: Muons) -> None:
        """Write muons, with the columns of the file, after those already written.

        Raises
        ------
        FailedError
            If they can't be written, for instance on a full disk.
        """
        self.append_columns(muons.columns)

    def append_columns(self, columns: Mapping[str, ArrayLike]) -> None:
        """Write muons, as all columns of the file by their names, after those already written.

        Raises
        ------
        FailedError
            As for `append`.
        """
        if columns.keys() != self._types.keys():
            raise ValueError(f"the columns are {', '.join(columns)}, and those of the file {', '.join(self._types)}")
        with self._partial.failures():
            self._in_thread(self._append, columns)

    def refer(self, paths: Iterable[str | Path], progress: Callable[[int], object] = lambda _: None) -> None:
        """Take all muons from other muon files, which keep them, instead of `append`.

        The file finds them by their paths relative to its folder.

        Parameters
        ----------
        paths
            The files, in the order of their muons.
        progress
            Called with 0 again and again, from another thread.

        Raises
        ------
        RefusedError
            If one of them can't be read, or keeps its muons in other files itself.
        FailedError
            As for `append`.
        """
        with self._partial.failures():
            self._in_thread(self._refer, paths, progress)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Publish the file, or remove it if the body raised."""
        try:
            if kind is None:
                with self._partial.failures():
                    self._in_thread(self._finish)
                    self._in_thread(self._close)  # an open file gets no other name on Windows
                    self._partial.publish()
        finally:
            self._discard()

    def _in_thread(self, function: Callable[..., None], *arguments: object) -> None:
        self._thread.submit(function, *arguments).result()

    def _open(self) -> None:
        self._backing = QuietFile(str(self._partial.path))
        self._partial.hold(self._backing.fileno())
        self._flush = EarlyFlush(self._backing.fileno())
        self._file = h5py.File(self._backing, "w", rdcc_nbytes=0)  # nothing is read again

    def _append(self, columns: Mapping[str, ArrayLike]) -> None:
        length = len(np.asarray(columns["pdg_id"]))
        if not self._growing:
            self._create_columns(length)
        for name, column in self._growing.items():
            column.append(columns[name])
        self.count += length
        self._raise_fault()
        self._flush.wrote(length * bytes_per_muon(self._types))

    def _create_columns(self, first_length: int) -> None:
        chunk = min(max(first_length, SMALLEST_CHUNK), LARGEST_CHUNK)
        group = self._file.create_group("muons")
        for name, dtype in self._types.items():
            self._growing[name] = GrowingColumn(group, name, dtype, chunk)

    def _refer(self, paths: Iterable[str | Path], progress: Callable[[int], object]) -> None:
        parts = []
        for path in paths:
            progress(0)
            part = self._part(path)
            if part.length:
                parts.append(part)
        if not parts:
            return
        ends = np.cumsum([part.length for part in parts]).tolist()
        group = self._file.create_group("muons")
        for name, dtype in self._types.items():
            sources = [Source(part.path, name, end - part.length, end) for part, end in zip(parts, ends, strict=True)]
            progress(0)
            self._columns[name] = create_virtual_column(group, name, dtype, sources)
            self._checksums[name] = joined_crc32((part.checksums[name], part.length * dtype.itemsize) for part in parts)
        self.count = ends[-1]
        self._raise_fault()

    def _part(self, path: str | Path) -> _Part:
        with opened(path) as file:
            if file.columns.keys() != self._types.keys():
                raise RefusedError(
                    f"{path} has the columns {', '.join(file.columns)}, and not {', '.join(self._types)}"
                )
            if any(isinstance(column, VirtualColumn) for column in file.columns.values()):
                raise RefusedError(f"{path} keeps its muons in other files: name those instead")
            relative = os.path.relpath(os.path.realpath(path), self.path.parent)
            return _Part(Path(relative), len(file), file.checksums)

    def _finish(self) -> None:
        """Write the attributes, and all that is in memory to the disk."""
        if not self._columns and not self._growing:
            self._create_columns(0)
        for name, growing in self._growing.items():
            growing.finish()
            self._columns[name], self._checksums[name] = growing.dataset, growing.checksum
        for name, column in self._columns.items():
            column.attrs["units"] = {**COLUMNS, **OPTIONAL_COLUMNS}[name][1]
            column.attrs[CHECKSUM] = np.uint32(self._checksums[name])
        self._file.attrs["format"] = FORMAT
        self._file.attrs["format_version"] = FORMAT_VERSION
        group = self._file["muons"]
        for name, value in self._description.of(self.count).items():
            is_texts = isinstance(value, list) and all(isinstance(item, str) for item in value)
            group.attrs.create(name, value, dtype=h5py.string_dtype() if is_texts else None)
        group.attrs[ATTRIBUTES_CHECKSUM] = np.uint32(attributes_crc32(stated(group)))
        self._file.close()
        self._raise_fault()
        self._flush.finish()

    def _raise_fault(self) -> None:
        if self._backing.error is not None:
            raise self._backing.error

    def _discard(self) -> None:
        """Let go of the temporary file, and of its temporary name."""
        try:
            self._in_thread(self._close)
        finally:
            self._thread.shutdown()
            self._partial.remove()

    def _close(self) -> None:
        for file in (getattr(self, name, None) for name in ("_file", "_flush", "_backing")):
            if file is not None:
                with suppress(OSError, RuntimeError):  # what it holds is on the disk already, or thrown away
                    file.close()


def write_muons(path: str | Path, muons: Muons, attributes: Mapping[str, object], overwrite: bool = False) -> None:
    """Write muons to a new file.

    Parameters
    ----------
    path, attributes, overwrite
        As for `MuonWriter`.
    muons
        The muons.

    Raises
    ------
    RefusedError, FailedError
        As for `MuonWriter`.
    """
    with MuonWriter(path, attributes, overwrite, optional=muons.columns.keys() - COLUMNS) as writer:
        writer.append(muons)


class _Part(NamedTuple):
    """A file that holds muons of another one."""

    path: Path
    length: int
    checksums: dict[str, int]
