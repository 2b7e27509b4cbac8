"""Tables in text: one heading at most, then numbers, separated by semicolons, commas, tabs, or else by blanks."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.format import FORMAT
from deepmuon_training.data.foreign.lines import Lines, read_lines
from deepmuon_training.data.foreign.table import Float, Place, Table

__all__ = ["open_text"]

SHOWN = 60  # characters of a bad line in its error

MISSING = {"", "na", "nan", "n/a", "nil", "none", "null", "inf", "-", "--", "?"}
"""What programs write where they have no number: no name of a column."""

FORTRAN = re.compile(r"(?<=[0-9.])(?:[dD]([+-]?[0-9]+)|([+-][0-9]{3}))(?![\w.])")
"""Exponents as only Fortran writes them: 1.5D+01, and 1.5-101, which has no room for the letter."""

DECIMAL_COMMA = re.compile(r"[+-]?[0-9]+,[0-9]+([eEdD][+-]?[0-9]+)?")

NOTE = re.compile(r"(\w+) = (.+)")


def open_text(path: str | Path, width: int | None = None, *, ends_with_newline: bool = False) -> Table:
    """Open a table in text.

    Lines that begin with # and blank lines are passed over. The first other line is a heading if it names each column,
    and so is the last comment above the numbers. Columns that are not asked for may hold text. Numbers may be in
    quotes, and have the exponents of Fortran.

    Parameters
    ----------
    path
        The file, plain or packed by gzip. The memory needed does not grow with its size.
    width
        How many columns it should have; as many as its first line if left out.
    ends_with_newline
        Whether a last line without a newline was cut off.

    Raises
    ------
    RefusedError
        Here or while its rows are read: if the file can't be read, has no row, another heading than one of so many
        names, or a line that is not so many columns.
    """
    comments: list[str] = []
    pieces = read_lines(path, comments, ends_with_newline=ends_with_newline)
    top = next(pieces, None)
    if top is None:
        raise RefusedError(f"{path} has no line of numbers: it {'holds comments alone' if comments else 'is empty'}")
    first = top.texts[0]
    separator = _separator(first)
    fields = _fields(first, separator)
    headings = tuple(fields) if _is_heading(fields) else ()
    width = width or len(fields)
    if headings:
        if len(headings) != width:
            raise RefusedError(
                f"{path}, line {top.numbers[0]}: {_shown(first)} is no heading of {width} columns: a comment "
                "begins with #"
            )
        top = Lines(top.numbers[1:], top.texts[1:])
    elif comments:
        names = _fields(comments[-1], _separator(comments[-1]))
        headings = tuple(names) if _is_heading(names) and len(names) == width else ()
    pieces = chain([top] if top.texts else [], pieces)
    return Table(
        path,
        width,
        lambda wanted: _rows(path, pieces, width, list(wanted), separator),
        headings,
        _notes(comments),
        _shown(first),
    )


def _notes(comments: Sequence[str]) -> dict[str, Any]:
    """Return what the comments of `deepmuon-convert` say; nothing of other comments is believed."""
    notes = {}
    for match in filter(None, map(NOTE.fullmatch, comments)):
        try:
            notes[match[1]] = json.loads(match[2])
        except ValueError:
            continue
    return notes if notes.get("format") == FORMAT else {}


def _separator(line: str) -> str | None:
    for mark in ";,":
        if mark in line:
            return mark
    fields = [field.strip() for field in line.split("\t")]
    is_tab = len(fields) > 1 and all(_is_name(field) or (field and " " not in field) for field in fields)
    return "\t" if is_tab else None


def _fields(line: str, separator: str | None) -> list[str]:
    if separator is None:
        fields = line.split()
    else:
        try:
            fields = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        except csv.Error:  # a field of more than 131,072 characters
            fields = line.split(separator)
    return [field.strip().strip("\"'").strip() for field in fields]


def _is_heading(fields: Sequence[str]) -> bool:
    """Tell whether these can be the names of columns; one may have none, as the row numbers of pandas."""
    names = [field for field in fields if field]
    return len(names) > 1 and len(set(fields)) == len(fields) and all(map(_is_name, names))


def _is_name(field: str) -> bool:
    return any(map(str.isalpha, field)) and field.lower() not in MISSING and not _is_number(field)


def _is_number(field: str) -> bool:
    try:
        float(FORTRAN.sub(r"e\1\2", field))
    except ValueError:
        return False
    return field.isascii() and "_" not in field  # of which Python makes numbers, and nobody else


def _rows(
    path: str | Path, pieces: Iterator[Lines], width: int, wanted: list[int], separator: str | None
) -> Iterator[tuple[Place, Float]]:
    is_empty = True
    for numbers, texts in pieces:
        rows = _parse(texts, width, wanted, separator)
        if rows is None:
            bad = _first_bad(texts, width, wanted, separator)
            raise RefusedError(
                f"{path}, line {numbers[bad]}: {_shown(texts[bad])} is no row of {width} columns: "
                f"{_why(texts[bad], width, wanted, separator)}"
            )
        yield _line_of(path, numbers), rows
        is_empty = False
    if is_empty:
        raise RefusedError(f"{path} has no line of numbers: it holds a heading alone")


def _line_of(path: str | Path, numbers: Sequence[int]) -> Place:
    return lambda index: f"{path}, line {numbers[index]}"


def _parse(texts: list[str], width: int, wanted: list[int], separator: str | None) -> Float | None:
    """Return the numbers, or None if a line is anything else."""
    if any(line.count('"') % 2 for line in texts):  # NumPy would look for the end in the lines below
        return None
    # A text of one letter takes what is not wanted: NumPy then counts the columns, and reads no number there.
    columns = np.dtype([(str(i), "f8" if i in wanted else "U1") for i in range(width)])
    for is_plain in (True, False):
        lines = texts if is_plain else _plain(texts, separator)
        try:
            rows = np.loadtxt(lines, columns, delimiter=separator, comments=None, quotechar='"', ndmin=1)
        except ValueError:
            continue
        if len(rows) == len(texts):  # a quote inside a field may still join lines
            return np.stack([rows[str(i)] for i in wanted], axis=1)
    return None


def _plain(texts: list[str], separator: str | None) -> list[str]:
    """Write Fortran's exponents as all others do, and leave blanks beside quotes out, which NumPy takes for text."""
    text = FORTRAN.sub(r"e\1\2", "\n".join(texts))
    if separator is not None and '"' in text:
        text = re.sub(rf'(?<=") *{separator}', separator, re.sub(rf'{separator} *(?=")', separator, text))
    return text.split("\n")


def _first_bad(texts: list[str], width: int, wanted: list[int], separator: str | None) -> int:
    """Return the position of the first line that is no row."""
    good, bad = 0, len(texts)  # the lines before `good` are good, and among those before `bad` one is not
    while bad - good > 1:
        middle = (good + bad) // 2
        if _parse(texts[good:middle], width, wanted, separator) is None:
            bad = middle
        else:
            good = middle
    return good


def _why(line: str, width: int, wanted: list[int], separator: str | None) -> str:
    """Say what keeps a line from being a row."""
    for mark in (";", "\t", None):
        fields = line.split(mark)
        if len(fields) > 1 and any(DECIMAL_COMMA.fullmatch(field.strip()) for field in fields):
            return "it looks like decimal commas, write decimal points"
    if line.count('"') % 2:
        return "a quote has no end"
    fields = _fields(line, separator)
    if len(fields) != width:
        return f"it has {len(fields)}"
    bad = next((fields[i] for i in wanted if not _is_number(fields[i])), "")
    return f"{_shown(bad)} is no number"


def _shown(text: str) -> str:
    return ascii(text if len(text) <= SHOWN else f"{text[:SHOWN]}...")
