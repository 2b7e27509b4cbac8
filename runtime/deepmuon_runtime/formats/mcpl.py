"""MCPL of version 3, the exchange format of Monte Carlo programs.

Source: T. Kittelmann et al., "Monte Carlo Particle Lists: MCPL", CPC 218 (2017) 17, and https://mctools.github.io/mcpl.
Kinetic energies are in MeV, places in cm, times in ms. What the file says of its muons stands in comments of its
header, a line each, and the live time once more in its statistics (stat:sum), which are added where files are merged.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.formats.notes import COLUMN_NAMES, notes, said, understood
from deepmuon_runtime.formats.packing import opened_bytes
from deepmuon_runtime.formats.source import PIECE, Columns, Source
from deepmuon_runtime.formats.writing import StreamWriter
from deepmuon_runtime.muon_file.checksum import crc32, unlike
from deepmuon_runtime.muon_file.format import CHECKSUM, PLACE, column_types

__all__ = ["MAGIC", "ROUNDING", "McplWriter", "PackedMcplWriter", "bytes_per_muon", "opened_mcpl"]

MAGIC = b"MCPL003L"
"""How a file begins: of version 3, little-endian."""

ROUNDING = 1e-6
"""How far a number may be from the muon file's, relative: to another unit, and of a direction's third component."""

MEV, CM, MS = 1e3, 1e2, 1e3  # of a GeV, a metre, a second
NAME = b"DeepMuon"

# After MAGIC: number of particles; numbers of comments and blobs, user flags, polarisation, single precision; a code
# of all particles, 0 for none; bytes of a particle; whether all have one weight, which follows.
_HEADER = struct.Struct("<Q5IiII")
_WEIGHT = struct.Struct("<d")
_LENGTH = struct.Struct("<I")
_LONGEST_TEXT = 1 << 20  # bytes
_MOST_TEXTS = 1 << 10

_LIVE_TIMES = {"target_live_time_s": "deepmuon_live_time_s", "live_time_s_m2": "deepmuon_live_time_s_m2"}
"""What the statistics call the live times, the first of which is that of a target."""


def record(single: bool) -> np.dtype[Any]:
    """Return the type of a particle."""
    real = "<f4" if single else "<f8"
    fields = [("place", real, 3), ("first", real), ("second", real), ("energy", real), ("time", real), ("code", "<i4")]
    return np.dtype(fields)


def is_single(names: Collection[str]) -> bool:
    """Tell whether numbers are float32: they are not where there is a time, which after a day has steps of 8 ms."""
    return "time" not in names


def bytes_per_muon(names: Collection[str]) -> int:
    """Return the bytes of a particle of a file with so many columns."""
    return record(is_single(names)).itemsize


class McplWriter(StreamWriter):
    """Writes an MCPL file; see `deepmuon_runtime.formats.writing.Writer`."""

    def _header(self, attributes: Mapping[str, Any], checksum: int) -> bytes:
        single = is_single(self._types)
        stated = said(attributes, **{COLUMN_NAMES: list(self._types), CHECKSUM: checksum})
        comments = [*notes(stated), *_statistics(attributes)]
        numbers = _HEADER.pack(self.count, len(comments), 0, 0, 0, single, 0, record(single).itemsize, 1)
        texts = b"".join(_LENGTH.pack(len(text)) + text for text in [NAME, *(line.encode() for line in comments)])
        return MAGIC + numbers + _WEIGHT.pack(1.0) + texts

    def _body(self, columns: Columns) -> bytes:
        return particles(columns).tobytes()


class PackedMcplWriter(McplWriter):
    """Writes an MCPL file that is packed by gzip."""

    packs = True


def _statistics(attributes: Mapping[str, Any]) -> Iterator[str]:
    for name, key in _LIVE_TIMES.items():
        if name in attributes:
            yield f"stat:sum:{key}:{float(attributes[name]):24.17g}"


def particles(columns: Columns) -> NDArray[Any]:
    """Return muons as particles of MCPL.

    Of a direction two components are kept and the largest is left out, but for its sign, which is that of the energy.
    In the place of a left out u or v stands 1/w, whose size above 1 tells which one it is.
    """
    single = is_single(columns.keys())
    u, v, w = (columns[name] for name in ("u", "v", "w"))
    new = np.zeros(len(u), record(single))
    if PLACE[0] in columns:
        for axis, name in enumerate(PLACE):
            new["place"][:, axis] = columns[name].astype(np.float64) * CM
    across_u, across_v, along = np.abs(u), np.abs(v), np.abs(w)
    no_w = along >= np.maximum(across_u, across_v)
    new["first"], new["second"] = u, v
    energy = columns["kinetic_energy"].astype(np.float64) * MEV
    sign = w
    if not no_w.all():
        no_u = ~no_w & (across_u >= across_v)
        no_v = ~no_w & ~no_u
        inverse = 1 / w.astype(np.float64)[~no_w]
        new["first"][no_u] = inverse[no_u[~no_w]]
        new["second"][no_v] = inverse[no_v[~no_w]]
        sign = np.where(no_w, w, np.where(no_u, u, v))
    new["energy"] = np.copysign(energy, sign)
    if "time" in columns:
        new["time"] = columns["time"] * MS
    new["code"] = columns["pdg_id"]
    return new


def columns_of(new: NDArray[Any], types: Mapping[str, np.dtype[Any]]) -> Columns:
    """Return particles as columns of a muon file."""
    with np.errstate(all="ignore"):  # of damaged numbers, too: whoever reads looks at what comes out
        first, second = new["first"].astype(np.float64), new["second"].astype(np.float64)
        energy = new["energy"].astype(np.float64)
        no_u, no_v = np.abs(first) > 1, np.abs(second) > 1
        w = np.where(no_u, 1 / first, np.where(no_v, 1 / second, 0.0))
        one, two = np.where(no_u, second, first), np.where(no_u | no_v, w, second)
        missing = np.copysign(np.sqrt(np.maximum(0.0, 1 - one * one - two * two)), energy)
        found = {
            "kinetic_energy": np.abs(energy) / MEV,
            "u": np.where(no_u, missing, first),
            "v": np.where(no_v, missing, second),
            "w": np.where(no_u | no_v, w, missing),
            "pdg_id": new["code"],
            **{name: new["place"][:, axis].astype(np.float64) / CM for axis, name in enumerate(PLACE)},
            "time": new["time"] / MS,
        }
        return {name: found[name].astype(dtype) for name, dtype in types.items()}


@contextmanager
def opened_mcpl(path: str | Path) -> Iterator[Source]:
    """Open an MCPL file that DeepMuon wrote, packed or not.

    Raises
    ------
    RefusedError
        Here or while it is read, if it can't be read, is damaged, or somebody else's.
    """
    with opened_bytes(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise RefusedError(f"{path} is no MCPL file of version 3, little-endian")
        count, comments, blobs, flags, polarisation, single, code, size, weighs = _HEADER.unpack(
            _exactly(file, _HEADER.size, path)
        )
        if weighs:
            _exactly(file, _WEIGHT.size, path)
        if comments > _MOST_TEXTS:
            raise RefusedError(f"{path} says that it has {comments} comments")
        _text(file, path)
        attributes, more = understood([_text(file, path) for _ in range(comments)], path)
        types = column_types(more.get(COLUMN_NAMES), path)
        kind = record(is_single(types))
        if (blobs, flags, polarisation, code, size, bool(single)) != (0, 0, 0, 0, kind.itemsize, is_single(types)):
            raise RefusedError(f"{path} was changed by another program: its particles have another form")
        if count != attributes["count"]:
            raise RefusedError(f"{path} has {count} particles, and says that it has {attributes['count']}")
        yield Source(attributes, tuple(types), lambda: _pieces(file, path, kind, types, count, more.get(CHECKSUM)))


def _pieces(
    file: BinaryIO, path: str | Path, kind: np.dtype[Any], types: Mapping[str, np.dtype[Any]], count: int, expected: Any
) -> Iterator[Columns]:
    checksum, left = 0, count
    while left:
        body = _exactly(file, min(left, PIECE) * kind.itemsize, path)
        checksum = crc32(body, checksum)
        yield columns_of(np.frombuffer(body, kind), types)
        left -= len(body) // kind.itemsize
    if file.read(1):
        raise RefusedError(f"{path} is damaged: there is more after its {count} particles")
    if checksum != expected:
        raise RefusedError(f"{path} is damaged: what it holds {unlike(checksum, expected)}")


def _exactly(file: BinaryIO, size: int, path: str | Path) -> bytes:
    data = file.read(size)
    if len(data) != size:
        raise RefusedError(f"{path} is damaged: it ends before its end")
    return data


def _text(file: BinaryIO, path: str | Path) -> str:
    (length,) = _LENGTH.unpack(_exactly(file, _LENGTH.size, path))
    if length > _LONGEST_TEXT:
        raise RefusedError(f"{path} is damaged: a comment of {length} bytes")
    return _exactly(file, length, path).decode("utf-8", "replace")
