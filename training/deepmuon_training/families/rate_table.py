"""Rates at depths from a table in CSV, that of a pipeline for instance."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from pathlib import Path

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_training.families.rates import KnownRate

__all__ = ["read_rates"]

DEPTH, RATE, UNCERTAINTY = "depth_m", "rate_hz_per_m2", "rate_uncertainty_hz_per_m2"


def read_rates(path: Path) -> tuple[KnownRate, ...]:
    """Read depths, rates and, if there is such a column, their uncertainties; a row without a rate is passed over.

    Raises
    ------
    RefusedError
        If the file can't be read, lacks a column, has none but such rows, or a number in it can't be.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rates = tuple(_rows(path, csv.DictReader(file)))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RefusedError(f"the table {path} can't be read: {reason(error)}") from error
    if not rates:
        raise RefusedError(f"{path} has no rate: below its names of columns, a line for each depth has one")
    return rates


def _rows(path: Path, reader: csv.DictReader[str]) -> Iterator[KnownRate]:
    names = reader.fieldnames or []
    for name in (DEPTH, RATE):
        if name not in names:
            raise RefusedError(
                f"{path} has no column {name}: its first line should be {DEPTH},{RATE},{UNCERTAINTY}, of which "
                "the last may be missing"
            )
    for row in reader:
        if row[RATE]:
            place = f"{path}, line {reader.line_num}"
            uncertainty = row.get(UNCERTAINTY)
            yield KnownRate(
                _number(row[DEPTH], place, DEPTH, zero=True),
                _number(row[RATE], place, RATE, zero=False),
                _number(uncertainty, place, UNCERTAINTY, zero=True) if uncertainty else None,
            )


def _number(text: str | None, place: str, name: str, *, zero: bool) -> float:
    try:
        number = float(text or "")
    except ValueError:
        number = math.nan
    if not (0 <= number < math.inf) or (number == 0 and not zero):
        wanted = "a finite number from 0 on" if zero else "a finite number above 0"
        raise RefusedError(f"{place}: {name} is {text!r}, and should be {wanted}")
    return number
