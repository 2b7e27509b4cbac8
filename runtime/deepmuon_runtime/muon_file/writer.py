"""Writes muon files: complete under their name, or not there."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple
from zlib import crc32

import h5py
import numpy as np
from numpy.typing import ArrayLike

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.files.early_flush import EarlyFlush
from deepmuon_runtime.files.partial import PartialFile
from deepmuon_runtime.files.quiet import QuietFile
from deepmuon_runtime.muon_file.attributes import LIVE_TIMES, value_defects
from deepmuon_runtime.muon_file.checksum import attributes_crc32, joined_crc32
from deepmuon_runtime.muon_file.format import (
    ATTRIBUTES_CHECKSUM,
    CHECKSUM,
    COLUMNS,
    FORMAT,
    FORMAT_VERSION,
    OPTIONAL_COLUMNS,
    bytes_per_muon,
    python_value,
    stated,
)
from deepmuon_runtime.muon_file.output import check_muon_output
from deepmuon_runtime.muon_file.reader import opened
from deepmuon_runtime.muon_file.virtual import Source, VirtualColumn, create_virtual_column
from deepmuon_runtime.muons import Muons

__all__ = ["MuonWriter", "write_muons"]

SOURCE_DATE_EPOCH = "SOURCE_DATE_EPOCH"
"""Environment variable that states the time of `created`, so that a repeated run gives the same bytes
(https://reproducible-builds.org/specs/source-date-epoch/)."""


def _stated_time() -> datetime | None:
    """Return the time that the environment states for all that is made, if it does.

    Raises
    ------
    RefusedError
        If it is none.
    """
    stated = os.environ.get(SOURCE_DATE_EPOCH)
    if stated is None:
        return None
    try:
        return datetime.fromtimestamp(int(stated), timezone.utc)
    except (ValueError, OverflowError, OSError) as error:
        raise RefusedError(
            f"{SOURCE_DATE_EPOCH} is {stated!r}, and should be whole seconds since 1970 (unset it for the present time)"
        ) from error


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
        On construction and entry, if `path` can't be written, an attribute is missing or can't be what it is, or
        SOURCE_DATE_EPOCH is no time.
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
        missing = [name for name in ("depth_m", "medium") if name not in attributes]
        if missing:
            raise RefusedError(f"a muon file must say its {' and '.join(missing)}: add it to the attributes")
        self.count = 0
        self._created = _stated_time()
        self._attributes = {name: _storable(value) for name, value in attributes.items()}
        for defect in _defects(self._attributes):
            raise RefusedError(f"{path} was not written: {defect}")
        self._types = {**COLUMNS, **{name: OPTIONAL_COLUMNS[name] for name in OPTIONAL_COLUMNS if name in optional}}
        self._columns: dict[str, h5py.Dataset] = {}
        self._checksums = dict.fromkeys(self._types, 0)

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
        # Whole chunks go straight to the file: a cache would only copy them once more.
        self._file = h5py.File(self._backing, "w", rdcc_nbytes=0)

    def _append(self, columns: Mapping[str, ArrayLike]) -> None:
        length = len(np.asarray(columns["pdg_id"]))
        if not self._columns:
            self._create_columns(length)
        end = self.count + length
        for name, column in self._columns.items():
            values = np.ascontiguousarray(columns[name], self._types[name][0])
            column.resize((end,))
            column[self.count : end] = values
            self._checksums[name] = crc32(values.data, self._checksums[name])
        self.count = end
        self._raise_fault()
        self._flush.wrote(length * bytes_per_muon(self._types))

    def _create_columns(self, first_length: int) -> None:
        chunk = min(max(first_length, SMALLEST_CHUNK), LARGEST_CHUNK)
        group = self._file.create_group("muons")
        for name, (dtype, _) in self._types.items():
            self._columns[name] = group.create_dataset(name, shape=(0,), maxshape=(None,), chunks=(chunk,), dtype=dtype)

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
        for name, (dtype, _) in self._types.items():
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
        if not self._columns:
            self._create_columns(0)
        for name, column in self._columns.items():
            column.attrs["units"] = self._types[name][1]
            column.attrs[CHECKSUM] = np.uint32(self._checksums[name])
        self._file.attrs["format"] = FORMAT
        self._file.attrs["format_version"] = FORMAT_VERSION
        group = self._file["muons"]
        for name, value in self._all_attributes().items():
            is_texts = isinstance(value, list) and all(isinstance(item, str) for item in value)
            group.attrs.create(name, value, dtype=h5py.string_dtype() if is_texts else None)
        group.attrs[ATTRIBUTES_CHECKSUM] = np.uint32(attributes_crc32(stated(group)))
        self._file.close()
        self._raise_fault()
        self._flush.finish()

    def _all_attributes(self) -> dict[str, Any]:
        attributes = {"created_by": f"deepmuon-runtime {version('deepmuon-runtime')}", **self._attributes}
        attributes["count"] = self.count
        attributes["created"] = (self._created or datetime.now(timezone.utc)).isoformat(timespec="seconds")
        for live_time, rate in LIVE_TIMES.items():
            if attributes.get(rate, 0) > 0:
                attributes[live_time] = self.count / float(attributes[rate])
        return attributes

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


def _storable(value: Any) -> Any:
    """Return an attribute with what HDF5 can't hold in a text escaped: the byte 0, and what is no UTF-8."""
    if isinstance(value, (list, tuple)):
        return [_storable(item) for item in value]
    if isinstance(value, str):
        return value.replace("\0", r"\x00").encode("utf-8", "backslashreplace").decode()
    return value


def _defects(attributes: Mapping[str, Any]) -> Iterator[str]:
    """Yield what keeps attributes from being written: no reader would take them."""
    attributes = {name: python_value(value) for name, value in attributes.items()}
    try:
        attributes_crc32(attributes)
    except ValueError as error:
        yield str(error)
    yield from value_defects(attributes)


class _Part(NamedTuple):
    """A file that holds muons of another one."""

    path: Path
    length: int
    checksums: dict[str, int]
