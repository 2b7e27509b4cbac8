"""Muons as comma-separated text, one a line, for programs that read nothing else.

What the file says of its muons stands above them in comments: # name = value, the value in JSON. Then comes a line with
the names of the columns, the energy's with its unit: kinetic_energy_GeV,u,v,w,pdg_id, and x,y,z in m and time in s,
where they are there. Nine digits tell any two float32 numbers apart, seventeen any two float64.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.formats.notes import FIRST_NOTE, notes, said, understood
from deepmuon_runtime.formats.packing import opened_bytes
from deepmuon_runtime.formats.source import Columns, Source
from deepmuon_runtime.formats.writing import StreamWriter
from deepmuon_runtime.muon_file.checksum import crc32, unlike
from deepmuon_runtime.muon_file.format import CHECKSUM, column_types

__all__ = ["UNITS", "CsvWriter", "PackedCsvWriter", "bytes_per_muon", "csv_pieces", "is_csv", "opened_csv"]

UNITS = {"GeV": 1.0, "MeV": 1e3}
"""Each unit of energy in a GeV."""

ENERGY = "kinetic_energy"
LINES = 1 << 15  # muons turned into text at once
BLOCK = 1 << 22  # bytes read at once, more than any line
_LONGEST_COMMENT = 1 << 20


def bytes_per_muon(names: Collection[str]) -> int:
    """Return the bytes that a line with so many columns takes at least."""
    return len("1,0,0,-1,13\n") + len(",0") * (len(names) - 5)


class CsvWriter(StreamWriter):
    """Writes comma-separated text; see `deepmuon_runtime.formats.writing.Writer`."""

    unit = "GeV"
    has_header = True

    def _header(self, attributes: Mapping[str, Any], checksum: int) -> bytes:
        return _header(attributes, self._types, self.unit, checksum) if self.has_header else b""

    def _body(self, columns: Columns) -> bytes:
        return b"".join(_lines(columns, UNITS[self.unit]))

    def shown_as(self, unit: str, has_header: bool) -> CsvWriter:
        """Choose the unit of the energy, one of `UNITS`, and whether there are comments and names; return itself."""
        self.unit, self.has_header = unit, has_header
        return self


class PackedCsvWriter(CsvWriter):
    """Writes comma-separated text that is packed by gzip."""

    packs = True


def csv_pieces(source: Source, *, unit: str = "GeV", header: bool = True) -> Iterator[bytes]:
    """Yield muons as text in pieces of whole lines, the header first; RefusedError at the end if they are damaged.

    Parameters
    ----------
    source
        An open file.
    unit
        Of the energy, one of `UNITS`.
    header
        Whether comments come first, and a line with the names of the columns. What text that goes by does not have is
        its own checksum.
    """
    if header:
        yield _header(source.attributes, source.names, unit, None)
    for columns in source.pieces():
        yield from _lines(columns, UNITS[unit])


def _header(attributes: Mapping[str, Any], names: Collection[str], unit: str, checksum: int | None) -> bytes:
    stated = said(attributes, **({} if checksum is None else {CHECKSUM: checksum}))
    comments = "".join(f"# {line}\n" for line in notes(stated))
    heading = ",".join(f"{name}_{unit}" if name == ENERGY else name for name in names)
    return f"{comments}{heading}\n".encode()


def _lines(columns: Columns, factor: float) -> Iterator[bytes]:
    line = ",".join(_FORMATS.get(values.dtype.kind + str(values.dtype.itemsize), "%d") for values in columns.values())
    for first in range(0, len(columns["pdg_id"]), LINES):
        part = {name: values[first : first + LINES].astype(np.float64) for name, values in columns.items()}
        part[ENERGY] *= factor
        rows = np.stack(list(part.values()), axis=1)
        yield (f"{line}\n" * len(rows) % tuple(rows.ravel().tolist())).encode()


_FORMATS = {"f4": "%.9g", "f8": "%.17g"}


def is_csv(beginning: bytes) -> bool:
    """Tell whether a file that begins so is one of ours."""
    return beginning.startswith(f"# {FIRST_NOTE}".encode())


@contextmanager
def opened_csv(path: str | Path) -> Iterator[Source]:
    """Open comma-separated text that DeepMuon wrote, packed or not, with its comments.

    Raises
    ------
    RefusedError
        Here or while it is read, if it can't be read, is damaged, or somebody else's.
    """
    with opened_bytes(path) as file:
        comments = []
        line = file.readline(_LONGEST_COMMENT)
        while line.startswith(b"# "):
            comments.append(line[2:].rstrip(b"\r\n").decode("utf-8", "replace"))
            line = file.readline(_LONGEST_COMMENT)
        attributes, more = understood(comments, path)
        heading = line.decode("ascii", "replace").strip().split(",")
        units = {f"{ENERGY}_{unit}": unit for unit in UNITS}
        if heading[0] not in units:
            raise RefusedError(f"{path} has no line {next(iter(units))},u,v,w,pdg_id after its comments")
        names = [ENERGY, *heading[1:]]
        types = column_types(names, path)
        yield Source(
            attributes,
            tuple(types),
            lambda: _pieces(file, path, names, types, UNITS[units[heading[0]]], attributes["count"], more),
        )


def _pieces(
    file: BinaryIO,
    path: str | Path,
    names: list[str],
    types: Mapping[str, np.dtype[Any]],
    factor: float,
    count: int,
    more: Mapping[str, Any],
) -> Iterator[Columns]:
    checksum, done, rest = 0, 0, b""
    while block := file.read(BLOCK):
        checksum = crc32(block, checksum)
        whole, newline, rest = (rest + block).rpartition(b"\n")
        if not newline:
            raise RefusedError(f"{path} is damaged: a line of more than {BLOCK} bytes after muon {done}")
        yield (columns := _numbers(whole, path, names, types, factor, done))
        done += len(columns["pdg_id"])
    if rest or done != count:
        raise RefusedError(f"{path} is damaged: it ends after {done} muons, and says that it has {count}")
    if CHECKSUM in more and checksum != more[CHECKSUM]:
        raise RefusedError(f"{path} is damaged: what it holds {unlike(checksum, more[CHECKSUM])}")


def _numbers(
    text: bytes, path: str | Path, names: list[str], types: Mapping[str, np.dtype[Any]], factor: float, done: int
) -> Columns:
    try:
        rows = np.loadtxt(text.decode("ascii").split("\n"), delimiter=",", comments=None, ndmin=2)
    except ValueError as error:
        raise RefusedError(f"{path} is damaged: after muon {done} are lines that are no muons") from error
    if rows.shape[1] != len(names):
        raise RefusedError(f"{path} is damaged: after muon {done} are lines of {rows.shape[1]} numbers")
    rows[:, 0] /= factor
    with np.errstate(over="ignore", invalid="ignore"):  # whoever reads looks at what comes out
        return {name: rows[:, names.index(name)].astype(dtype) for name, dtype in types.items()}
