"""Writing muons to a file of any format: complete under its name, or not there."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.files.early_flush import EarlyFlush
from deepmuon_runtime.files.partial import PartialFile
from deepmuon_runtime.formats.packing import packed, wrapped
from deepmuon_runtime.formats.source import Columns
from deepmuon_runtime.muon_file.attributes import Description
from deepmuon_runtime.muon_file.checksum import crc32
from deepmuon_runtime.muon_file.format import COLUMNS, column_types
from deepmuon_runtime.muons import Muons

__all__ = ["StreamWriter", "Writer"]


class Writer(ABC):
    """Writes muons piece by piece, as `MuonWriter` does, to a file of another format.

    Parameters
    ----------
    path, attributes, overwrite, optional
        As for `MuonWriter`.

    Attributes
    ----------
    path, count
        As those of `MuonWriter`.

    Raises
    ------
    RefusedError, FailedError
        As `MuonWriter`.
    """

    def __init__(
        self,
        path: str | Path,
        attributes: Mapping[str, object],
        overwrite: bool = False,
        *,
        optional: Collection[str] = (),
    ) -> None:
        self._partial = PartialFile(path, overwrite)
        self.path = self._partial.target
        self.count = 0
        self._description = Description(path, attributes)
        self._types = column_types([*COLUMNS, *optional], path)

    def __enter__(self) -> Writer:
        """Create the temporary file."""
        self._partial.begin()
        try:
            self._file: BinaryIO = self._partial.path.open("x+b")
            self._partial.hold(self._file.fileno())
            self._flush = EarlyFlush(self._file.fileno())
            self._begin()
        except BaseException as error:
            self._discard()
            if isinstance(error, OSError):
                raise RefusedError(f"{self.path} can't be written: {reason(error)}") from error
            raise
        return self

    def append(self, muons: Muons) -> None:
        """Write muons, with the columns of the file, after those already written."""
        self.append_columns(muons.columns)

    def append_columns(self, columns: Mapping[str, ArrayLike]) -> None:
        """Write muons, as all columns of the file by their names, after those already written."""
        if columns.keys() != self._types.keys():
            raise ValueError(f"the columns are {', '.join(columns)}, and those of the file {', '.join(self._types)}")
        with self._partial.failures():
            typed = {name: np.ascontiguousarray(columns[name], dtype) for name, dtype in self._types.items()}
            self._append(typed)
            self.count += len(typed["pdg_id"])

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Publish the file, or remove it if the body raised."""
        try:
            if kind is None:
                with self._partial.failures():
                    self._finish()
                    self._file.flush()
                    self._flush.finish()
                    self._close()  # an open file gets no other name on Windows
                    self._partial.publish()
        finally:
            self._discard()

    @abstractmethod
    def _begin(self) -> None:
        """Write what comes before the muons."""

    @abstractmethod
    def _append(self, columns: Columns) -> None:
        """Write muons, as columns of the types of a muon file."""

    @abstractmethod
    def _finish(self) -> None:
        """Write what is known only now, that there are `count` muons among it."""

    def _close(self) -> None:
        self._flush.close()
        self._file.close()

    def _discard(self) -> None:
        try:
            with suppress(AttributeError, OSError):  # never opened; what it holds is on the disk, or thrown away
                self._close()
        finally:
            self._partial.remove()


class StreamWriter(Writer):
    """A file that is a header and then the muons, one after the other; packed by gzip or not.

    The header has one length, whatever is known when it is written: it is written twice.
    """

    packs = False

    def _begin(self) -> None:
        self._checksum = 0
        self._write_header()

    def _append(self, columns: Columns) -> None:
        body = self._body(columns)
        self._checksum = crc32(body, self._checksum)
        if self.packs:
            body = packed(body)
        self._file.write(body)
        self._flush.wrote(len(body))

    def _finish(self) -> None:
        self._file.seek(0)
        self._write_header()

    def _write_header(self) -> None:
        header = self._header(self._description.of(self.count), self._checksum)
        self._file.write(wrapped(header) if self.packs else header)

    @abstractmethod
    def _header(self, attributes: Mapping[str, Any], checksum: int) -> bytes:
        """Return the header, as long as that of other attributes of the same names but for what `count` decides."""

    @abstractmethod
    def _body(self, columns: Columns) -> bytes:
        """Return muons as they stand in the file."""
