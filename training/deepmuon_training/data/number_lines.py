"""Text whose lines are numbers, read in pieces: a line that is something else is refused by its number."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError, reason

__all__ = ["read_number_lines"]

PIECE = 1 << 18
"""Bytes read at once, which the processor's cache holds, and more than any line has."""

SHOWN = 60  # characters of a bad line in its error

Float = NDArray[np.float64]


def read_number_lines(
    path: str | Path, columns: int, *, ends_with_newline: bool = False
) -> Iterator[tuple[int, Float]]:
    """Read lines of numbers with commas, or else blanks or tabs, between them.

    Lines at the top that start with # or hold no number are a header; empty lines at the end do not count.

    Parameters
    ----------
    path
        The file. The memory needed does not grow with its size.
    columns
        How many numbers a line has.
    ends_with_newline
        Whether a last line without a newline was cut off.

    Yields
    ------
    line : int
        Number of the first of these lines, from 1 at the top of the file.
    numbers : float64 [lines, columns]
        NaN and infinity are numbers.

    Raises
    ------
    RefusedError
        If the file can't be read, has no line of numbers, or a line that is not so many numbers.
    """
    try:
        with Path(path).open("rb") as file:
            line, top = _skip_header(file)
            separator = "," if b"," in top else None
            for piece in _whole_lines(file, top):
                text = piece.decode("latin-1").rstrip()
                numbers = _parse(text, columns, separator)
                if numbers is None:
                    bad, shown = _first_bad(text, columns, separator)
                    raise RefusedError(f"{path}, line {line + bad}: {shown} is not {columns} numbers")
                yield line, numbers
                line += len(numbers)
                if ends_with_newline and not piece.endswith(b"\n"):
                    raise RefusedError(f"{path}, line {line - 1} has no end: the file was cut off")
            if not top:
                raise RefusedError(f"{path} has no line of {columns} numbers")
    except OSError as error:
        raise RefusedError(f"{path} can't be read: {reason(error)}") from error


def _skip_header(file: BinaryIO) -> tuple[int, bytes]:
    """Return the number of the first line of numbers, and the line."""
    number = 1
    while line := file.readline(PIECE):
        if not line.startswith(b"#") and any(_is_number(field) for field in line.replace(b",", b" ").split()):
            break
        number += 1
    return number, line


def _is_number(field: bytes) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True


def _whole_lines(file: BinaryIO, rest: bytes) -> Iterator[bytes]:
    """Yield `rest` and what follows it in pieces that end with a line that is not empty."""
    while data := file.read(PIECE):
        rest += data
        end = rest.rstrip().rfind(b"\n") + 1
        if end:
            yield rest[:end]
            rest = rest[end:]
        elif len(rest) > PIECE:
            raise RefusedError(f"{file.name} is no text of numbers: it has a line of more than {PIECE:,} bytes")
    if rest.strip():
        yield rest


def _parse(text: str, columns: int, separator: str | None) -> Float | None:
    """Return the numbers, or None if a line is anything else."""
    lines = text.count("\n") + 1
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            numbers = np.loadtxt(StringIO(text), delimiter=separator, comments=None, ndmin=2)
    except (ValueError, UserWarning):  # the warning: there is no line at all
        return None
    return numbers if numbers.shape == (lines, columns) else None


def _first_bad(text: str, columns: int, separator: str | None) -> tuple[int, str]:
    """Return the position of the first line that is not so many numbers, and its text."""
    lines = text.split("\n")
    good, bad = 0, len(lines)  # the lines before `good` are good, and among those before `bad` one is not
    while bad - good > 1:
        middle = (good + bad) // 2
        if _parse("\n".join(lines[good:middle]), columns, separator) is None:
            bad = middle
        else:
            good = middle
    found = lines[good].strip()
    return good, ascii(found if len(found) <= SHOWN else f"{found[:SHOWN]}...")
