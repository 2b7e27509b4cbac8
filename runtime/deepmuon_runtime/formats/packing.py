"""gzip, in pieces that are packed apart and make one file together (RFC 1952 calls them members)."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from deepmuon_runtime.errors import RefusedError, reason

__all__ = ["PACKED", "opened_bytes", "packed", "wrapped"]

PACKED = b"\x1f\x8b"
"""How a packed file begins."""

_GZIP = 31  # zlib's number for 32 kB of history and gzip's header
_LEVEL = 1  # muons are random numbers: more work hardly shrinks them further


def packed(data: bytes) -> bytes:
    """Return bytes as a piece of a gzip file."""
    return _member(data, _LEVEL)


def wrapped(data: bytes) -> bytes:
    """Return bytes as a piece that is not smaller, and as long as that of any others of their length."""
    return _member(data, 0)


def _member(data: bytes, level: int) -> bytes:
    packer = zlib.compressobj(level, wbits=_GZIP)
    return packer.compress(data) + packer.flush()


@contextmanager
def opened_bytes(path: str | Path) -> Iterator[BinaryIO]:
    """Open a file for reading, unpacked if it is packed.

    Raises
    ------
    RefusedError
        If it can't be read, now or in the body of the `with` statement.
    """
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise RefusedError(f"{path} can't be read: it is a folder, a pipe or a device")
        with open(path, "rb") as file:
            is_packed = file.read(2) == PACKED
            file.seek(0)
            if not is_packed:
                yield file
                return
            with gzip.GzipFile(fileobj=file) as unpacked:
                yield cast(BinaryIO, unpacked)
    except (OSError, EOFError, zlib.error, ValueError) as error:
        raise RefusedError(f"{path} can't be read: {reason(error)}") from error
