"""Muons in HDF5: the file format, version 1.

::

    /                       format="deepmuon-muons", format_version=1
    /muons/kinetic_energy   float32  units="GeV"
    /muons/u, v, w          float32  units="1"
    /muons/pdg_id           int8     13 = mu-, -13 = mu+
    /muons attributes       count, depth_m, medium, created, created_by, and what else is known

Each column has the attribute crc32, the CRC-32 of its bytes one after the other.

A file is written under a temporary name in its own folder (`NAME.<8 hex digits>.deepmuon-partial`), flushed
to disk, and only then linked to its name: under that name there is a complete file or none.
"""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple
from zlib import crc32

import h5py
import numpy as np

from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_runtime.files.early_flush import EarlyFlush
from deepmuon_runtime.files.partial import PARTIAL_SUFFIX, hold, new_partial, warn_of_leftovers
from deepmuon_runtime.files.publish import publish
from deepmuon_runtime.files.quiet import QuietFile
from deepmuon_runtime.muon_file.checksum import joined_crc32
from deepmuon_runtime.muon_file.damage import READ_ERRORS, reason
from deepmuon_runtime.muon_file.virtual import Source, VirtualColumn, create_virtual_column
from deepmuon_runtime.muons import Muons

__all__ = [
    "BYTES_PER_MUON",
    "CHECKSUM",
    "COLUMNS",
    "FORMAT",
    "FORMAT_VERSION",
    "PARTIAL_SUFFIX",
    "READ_ERRORS",
    "MuonWriter",
    "check_format",
    "check_output",
    "python_value",
    "read_attributes",
    "read_checksums",
    "read_muons",
    "read_pieces",
    "reason",
    "write_muons",
]

FORMAT = "deepmuon-muons"
FORMAT_VERSION = 1

CHECKSUM = "crc32"
"""The attribute of a column with the CRC-32 of its bytes."""

COLUMNS: dict[str, tuple[np.dtype[Any], str]] = {
    "kinetic_energy": (np.dtype("<f4"), "GeV"),
    "u": (np.dtype("<f4"), "1"),
    "v": (np.dtype("<f4"), "1"),
    "w": (np.dtype("<f4"), "1"),
    "pdg_id": (np.dtype("i1"), "1"),
}
"""Type and unit of each dataset of `/muons`."""

REQUIRED_ATTRIBUTES = ("count", "depth_m", "medium", "created", "created_by")

BYTES_PER_MUON = sum(dtype.itemsize for dtype, _ in COLUMNS.values())

LARGEST_CHUNK = 1 << 17  # muons of one HDF5 chunk: smaller ones cost time and memory, larger ones gain nothing
SMALLEST_CHUNK = 1 << 10  # but a file of a few muons should not carry a large empty chunk


def check_output(path: str | Path, overwrite: bool = False) -> Path:
    """Tell whether a muon file can be written at `path`, before any muon is made.

    Parameters
    ----------
    path
        The wanted file; a symbolic link is followed.
    overwrite
        Whether a file that exists may be replaced.

    Returns
    -------
    The absolute path, links followed.

    Raises
    ------
    RefusedError
        If something other than a file is there, or a file and `overwrite` is false, or its folder is missing
        or not writable.
    """
    try:
        target = Path(os.path.realpath(path))
        if target.is_dir():
            raise RefusedError(f"{path} is a folder: give the name of a file in it")
        if target.exists() and not target.is_file():
            raise RefusedError(f"{path} is a device or a pipe, and HDF5 needs a regular file")
        if target.exists() and not overwrite:
            raise RefusedError(
                f"{path} exists already: choose another name, or ask for it to be overwritten (--overwrite)"
            )
        if not target.parent.is_dir():
            raise RefusedError(f"{path} can't be written: there is no folder {target.parent}")
        if not os.access(target.parent, os.W_OK | os.X_OK):
            raise RefusedError(f"{path} can't be written: the folder {target.parent} is not writable")
    except (OSError, ValueError) as error:  # a name too long, a null byte, a folder that may not be searched
        raise RefusedError(f"{path} can't be written: {reason(error)}") from error
    return target


class MuonWriter:
    """Writes a muon file piece by piece, and gives it its name only when it is complete.

    Use it in a `with` statement. If the body raises, or is interrupted, nothing is left behind.

    Parameters
    ----------
    path
        The file to be written; its folder must exist.
    attributes
        What the file says of its muons: `depth_m` and `medium` at least; strings, numbers, booleans, or lists
        of strings. `count` and `created` are added, `created_by` unless given, and
        `live_time_s_m2 = count / rate_hz_per_m2` where the rate is.
    overwrite
        Whether an existing file is replaced, at the moment when the new one is complete.

    Attributes
    ----------
    path : Path
        The absolute path of the file, links followed.
    count : int
        Muons written so far.

    Raises
    ------
    RefusedError
        On construction and entry, if `path` can't be written or an attribute is missing.
    FailedError
        Later, if writing fails (disk full), or another process has written `path` meanwhile.
    """

    # HDF5 calls back into Python (QuietFile), and must not meet a KeyboardInterrupt there. Python handles
    # signals in the main thread only, so all calls of HDF5 are made by a thread of their own.

    def __init__(self, path: str | Path, attributes: Mapping[str, object], overwrite: bool = False) -> None:
        self.path = check_output(path, overwrite)
        missing = [name for name in ("depth_m", "medium") if name not in attributes]
        if missing:
            raise RefusedError(f"a muon file must say its {' and '.join(missing)}: add it to the attributes")
        self.count = 0
        self._attributes = dict(attributes)
        self._overwrite = overwrite
        self._partial = new_partial(self.path)
        self._columns: dict[str, h5py.Dataset] = {}
        self._checksums = dict.fromkeys(COLUMNS, 0)

    def __enter__(self) -> MuonWriter:
        """Create the temporary file."""
        warn_of_leftovers(self.path)
        self._remove = weakref.finalize(self, _remove, self._partial)  # at the latest when the process ends
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
        """Write muons after those already written.

        Raises
        ------
        FailedError
            If they can't be written, for instance on a full disk.
        """
        with self._failures():
            self._in_thread(self._append, muons)

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
        with self._failures():
            self._in_thread(self._refer, paths, progress)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Publish the file, or remove it if the body raised."""
        try:
            if kind is None:
                with self._failures():
                    self._in_thread(self._finish)
                    publish(self._partial, self.path, self._overwrite)
        finally:
            self._discard()

    def _in_thread(self, function: Callable[..., None], *arguments: object) -> None:
        self._thread.submit(function, *arguments).result()

    def _open(self) -> None:
        self._backing = QuietFile(str(self._partial))
        hold(self._backing.fileno())
        self._flush = EarlyFlush(self._backing.fileno())
        # Whole chunks go straight to the file: a cache would only copy them once more.
        self._file = h5py.File(self._backing, "w", rdcc_nbytes=0)

    def _append(self, muons: Muons) -> None:
        if not self._columns:
            self._create_columns(len(muons))
        end = self.count + len(muons)
        for name, column in self._columns.items():
            values = np.ascontiguousarray(getattr(muons, name), COLUMNS[name][0])
            column.resize((end,))
            column[self.count : end] = values
            self._checksums[name] = crc32(values.data, self._checksums[name])
        self.count = end
        self._raise_fault()
        self._flush.wrote(len(muons) * BYTES_PER_MUON)

    def _create_columns(self, first_length: int) -> None:
        chunk = min(max(first_length, SMALLEST_CHUNK), LARGEST_CHUNK)
        group = self._file.create_group("muons")
        for name, (dtype, _) in COLUMNS.items():
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
        for name, (dtype, _) in COLUMNS.items():
            sources = [
                Source(part.path, f"muons/{name}", end - part.length, end)
                for part, end in zip(parts, ends, strict=True)
            ]
            progress(0)
            self._columns[name] = create_virtual_column(group, name, dtype, sources)
            self._checksums[name] = joined_crc32((part.checksums[name], part.length * dtype.itemsize) for part in parts)
        self.count = ends[-1]
        self._raise_fault()

    def _part(self, path: str | Path) -> _Part:
        with _opened(path) as group:
            if any(group[name].is_virtual for name in COLUMNS):
                raise RefusedError(f"{path} keeps its muons in other files: name those instead")
            relative = os.path.relpath(os.path.realpath(path), self.path.parent)
            return _Part(Path(relative), len(group["pdg_id"]), _checksums(group))

    def _finish(self) -> None:
        """Write the attributes, and all that is in memory to the disk."""
        if not self._columns:
            self._create_columns(0)
        for name, column in self._columns.items():
            column.attrs["units"] = COLUMNS[name][1]
            column.attrs[CHECKSUM] = np.uint32(self._checksums[name])
        self._file.attrs["format"] = FORMAT
        self._file.attrs["format_version"] = FORMAT_VERSION
        for name, value in self._all_attributes().items():
            if isinstance(value, (list, tuple)):
                self._file["muons"].attrs.create(name, list(value), dtype=h5py.string_dtype())
            else:
                self._file["muons"].attrs[name] = value
        self._file.close()
        self._raise_fault()
        self._flush.finish()

    def _all_attributes(self) -> dict[str, object]:
        attributes = {"created_by": f"deepmuon-runtime {version('deepmuon-runtime')}", **self._attributes}
        attributes["count"] = self.count
        attributes["created"] = datetime.now(timezone.utc).isoformat(timespec="seconds")
        rate = attributes.get("rate_hz_per_m2")
        if isinstance(rate, (int, float, np.number)) and rate > 0:
            attributes["live_time_s_m2"] = self.count / float(rate)
        return attributes

    def _raise_fault(self) -> None:
        if self._backing.error is not None:
            raise self._backing.error

    @contextmanager
    def _failures(self) -> Iterator[None]:
        try:
            yield
        except FileExistsError as error:
            raise FailedError(f"{self.path} was written by another process meanwhile: kept as it is") from error
        except OSError as error:
            raise FailedError(f"{self.path} was not written: {reason(error)}") from error

    def _discard(self) -> None:
        """Let go of the temporary file, and of its temporary name."""
        try:
            self._in_thread(self._close)
        finally:
            self._thread.shutdown()
            self._remove()

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
    with MuonWriter(path, attributes, overwrite) as writer:
        writer.append(muons)


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
    with _opened(path) as group:
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
    with _opened(path) as group:
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
    with _opened(path) as group:
        return _checksums(group)


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
    with _opened(path) as group:
        return {name: python_value(value) for name, value in group.attrs.items()}


@contextmanager
def _opened(path: str | Path) -> Iterator[h5py.Group]:
    """Open the group `/muons` of a file that keeps the format, turning HDF5's errors into one line."""
    try:
        with h5py.File(path, "r") as file:
            yield _checked(file, path)
    except READ_ERRORS as error:
        raise RefusedError(f"{path} can't be read as a muon file: {reason(error)}") from error


def check_format(file: h5py.File, path: str | Path) -> None:
    """Raise RefusedError unless a file says that it is a muon file of this version."""
    form, form_version = file.attrs.get("format"), file.attrs.get("format_version")
    if form != FORMAT:
        raise RefusedError(f"{path} is no muon file: it lacks the attribute format={FORMAT!r}")
    if form_version != FORMAT_VERSION:
        raise RefusedError(f"{path} has format version {form_version}, and this release reads version {FORMAT_VERSION}")


def _readable(column: h5py.Dataset) -> h5py.Dataset | VirtualColumn:
    return VirtualColumn(column) if column.is_virtual else column


def _checksums(group: h5py.Group) -> dict[str, int]:
    return {name: int(group[name].attrs[CHECKSUM]) for name in COLUMNS}


class _Part(NamedTuple):
    """A file that holds muons of another one."""

    path: Path
    length: int
    checksums: dict[str, int]


def _checked(file: h5py.File, path: str | Path) -> h5py.Group:
    check_format(file, path)
    group = file.get("muons")
    if not isinstance(group, h5py.Group):
        raise RefusedError(f"{path} has no group /muons")
    for name in REQUIRED_ATTRIBUTES:
        if name not in group.attrs:
            raise RefusedError(f"{path} lacks the attribute {name} of /muons")
    count = group.attrs["count"]
    for name, (dtype, _) in COLUMNS.items():
        column = group.get(name)
        if not isinstance(column, h5py.Dataset) or column.dtype != dtype or column.shape != (count,):
            found = f"{column.dtype} {column.shape}" if isinstance(column, h5py.Dataset) else "none"
            raise RefusedError(f"{path}: the column {name} should be {dtype} of ({count},), and is {found}")
    return group


def python_value(value: Any) -> Any:
    """Return an attribute as Python's str, int, float, bool, or a list of them."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.item() if isinstance(value, np.generic) else value


def _remove(path: Path) -> None:
    with suppress(OSError):  # never made, already in its place, or its folder is gone
        path.unlink()
