"""Text of any common encoding as lines, in pieces: unpacked, and without comments and blank lines."""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple, TextIO

from deepmuon_runtime.errors import RefusedError, reason

__all__ = ["Lines", "read_lines"]

PIECE = 1 << 18
"""Characters read at once, which the processor's cache holds, and more than any line has."""

MOST_COMMENTS = 1000  # above the first row; a file of nothing else is no reason to fill the memory

_GZIP = b"\x1f\x8b"

_BINARY = {
    b"\x93NUMPY": "a NumPy file, for --format npy",
    b"root\0": "a ROOT file, for --format root",
    b"MCPL0": "an MCPL file, for --format mcpl",
    b"\x89HDF": "an HDF5 file",
    b"PAR1": "a Parquet file: write it as text first",
    b"PK\x03\x04": "a zip archive or a spreadsheet: write it as text first",
    b"BZh": "compressed by bzip2: unpack it first",
    b"\xfd7zXZ": "compressed by xz: unpack it first",
    b"\x28\xb5\x2f\xfd": "compressed by zstd: unpack it first",
    b"%PDF": "a PDF",
}
"""What files begin with that are no text."""

_ENCODINGS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}
"""By the byte order mark at a file's begin; UTF-8 without one."""


class Lines(NamedTuple):
    """Lines that are neither blank nor comments, and their numbers in the file, from 1."""

    numbers: Sequence[int]
    texts: list[str]


def read_lines(path: str | Path, comments: list[str], *, ends_with_newline: bool = False) -> Iterator[Lines]:
    """Read a text, plain or packed by gzip, in UTF-8 or with a byte order mark.

    Parameters
    ----------
    path
        The file. The memory needed does not grow with its size.
    comments
        Gets the lines above the first other one that begin with #, without that.
    ends_with_newline
        Whether a last line without a newline was cut off.

    Raises
    ------
    RefusedError
        If the file can't be read, is no text, or has a line of more than `PIECE` characters.
    """
    number, rest, begun = 1, "", False
    try:
        with _opened(path) as file:
            while data := file.read(PIECE):
                whole, newline, rest = (rest + data).rpartition("\n")
                if newline:
                    lines = whole.split("\n")
                    found = _without_comments(lines, number, [] if begun else comments)
                    number += len(lines)
                    if found.texts:
                        begun = True
                        yield found
                elif len(rest) > PIECE:
                    raise RefusedError(f"{path}, line {number} has more than {PIECE:,} characters: this is no table")
    except (OSError, EOFError, zlib.error, UnicodeError) as error:
        raise RefusedError(f"{path} can't be read: {reason(error)}") from error
    last = _without_comments([rest], number, [] if begun else comments)
    if last.texts:
        yield last
        if ends_with_newline:
            raise RefusedError(f"{path}, line {number} has no end: the file was cut off")


@contextmanager
def _opened(path: str | Path) -> Iterator[TextIO]:
    with Path(path).open("rb") as raw:
        file = io.BufferedReader(gzip.GzipFile(fileobj=raw)) if raw.peek(2).startswith(_GZIP) else raw
        head = file.peek(512)
        for begin, what in _BINARY.items():
            if head.startswith(begin):
                raise RefusedError(f"{path} is no text: it is {what}")
        encoding = next((name for mark, name in _ENCODINGS.items() if head.startswith(mark)), "utf-8")
        if encoding != "utf-16" and b"\0" in head:
            raise RefusedError(f"{path} is no text: it holds zero bytes, as binary files do, and UTF-16 without a mark")
        yield io.TextIOWrapper(file, encoding, errors="strict" if encoding == "utf-16" else "backslashreplace")


def _without_comments(lines: list[str], first: int, comments: list[str]) -> Lines:
    """Return what is neither blank nor a comment, and collect comments that come before it."""
    texts = [line.strip() for line in lines]
    kept = [i for i, text in enumerate(texts) if text and text[0] != "#"]
    if len(kept) == len(texts):
        return Lines(range(first, first + len(texts)), texts)
    above = texts[: kept[0] if kept else None]
    comments += [text[1:].strip() for text in above if text][: MOST_COMMENTS - len(comments)]
    return Lines([first + i for i in kept], [texts[i] for i in kept])
