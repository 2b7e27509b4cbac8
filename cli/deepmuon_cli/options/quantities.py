"""Numbers as users write them: types of click options."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from decimal import Decimal, InvalidOperation
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from deepmuon_runtime import Shard

__all__ = [
    "degrees",
    "depth_metres",
    "gev",
    "metres",
    "muon_number",
    "number_from_zero",
    "positive_number",
    "seconds",
    "seed_number",
    "shard_number",
    "size",
    "square_metres",
    "thread_number",
]

# What users write after a number, and how many of the option's own units that is.
MULTIPLES = {"k": 1e3, "m": 1e6, "million": 1e6, "g": 1e9, "b": 1e9, "billion": 1e9}
METRES = {"m": 1, "metre": 1, "meter": 1, "cm": 0.01, "km": 1e3, "ft": 0.3048}
OF_WATER = {"mwe": 1, "m.w.e.": 1, "m w.e.": 1, "kmwe": 1e3, "km.w.e.": 1e3, "km w.e.": 1e3}  # metres water equivalent
ROCK = 2.65  # g/cm3, of the standard rock
GEV = {"gev": 1, "ev": 1e-9, "kev": 1e-6, "mev": 1e-3, "tev": 1e3}
DEGREES = {**dict.fromkeys(("degree", "deg", "°"), 1.0), **dict.fromkeys(("radian", "rad"), 180 / math.pi)}
SQUARE_METRES = {"m2": 1, "m^2": 1, "m²": 1, "cm2": 1e-4, "cm^2": 1e-4, "cm²": 1e-4, "km2": 1e6, "km²": 1e6}
SECONDS = {
    **dict.fromkeys(("s", "sec", "second"), 1.0),
    **dict.fromkeys(("min", "minute"), 60.0),
    **dict.fromkeys(("h", "hr", "hour"), 3600.0),
    **dict.fromkeys(("d", "day"), 86400.0),
    **dict.fromkeys(("w", "week"), 604800.0),
    **dict.fromkeys(("y", "yr", "year"), 31557600.0),
}


def muon_number(text: str) -> int:
    """Read a number of muons, exact however it is written: 1000, 1e7, 10_000_000.

    Raises
    ------
    click.BadParameter
        If it is no number, not whole, below 1, or above 2^53.
    """
    from deepmuon_runtime.sampling.numbers import LARGEST_NUMBER

    try:
        number = Decimal(text)
    except InvalidOperation as error:
        whole = [_shortest(number) for number in _meant(text, MULTIPLES) if number == int(number)]
        meant = whole[0] if whole else "for instance 1e7 or 10_000_000"
        raise click.BadParameter(f"{text} is no number: write {meant}") from error
    if number.is_nan() or not 0 < number <= LARGEST_NUMBER:
        raise click.BadParameter(f"{text} muons can't be made: the number is from 1 to 2^53")
    if number != number.to_integral_value():
        raise click.BadParameter(f"{text} is not a whole number: write {math.ceil(number)}")
    return int(number)


def seed_number(text: str) -> int:
    """Read a seed.

    Raises
    ------
    click.BadParameter
        If it is not a whole number from 0 to 2^64 - 1.
    """
    from deepmuon_runtime.latents.philox import LARGEST_SEED

    seed = _whole_number(text)
    if not 0 <= seed <= LARGEST_SEED:
        raise click.BadParameter(f"{text} is not from 0 to 2^64 - 1")
    return seed


def shard_number(text: str) -> Shard:
    """Read which part of a run, i/k.

    Raises
    ------
    click.BadParameter
        If it is none of 1/k to k/k.
    """
    from deepmuon_runtime.errors import RefusedError
    from deepmuon_runtime.latents.shard import Shard

    try:
        return Shard.parse(text)
    except RefusedError as error:
        raise click.BadParameter(str(error)) from error


def thread_number(text: str) -> int:
    """Read a number of threads; which of them there can be is the library's to say.

    Raises
    ------
    click.BadParameter
        If it is not a whole number.
    """
    return _whole_number(text)


def positive_number(text: str) -> float:
    """Read a number above 0.

    Raises
    ------
    click.BadParameter
        If it is not a finite number above 0.
    """
    return _positive(text, _number(text))


def seconds(text: str) -> float:
    """Read a time in seconds.

    Raises
    ------
    click.BadParameter
        If it is not a finite number above 0.
    """
    return _positive(text, _number(text, "number of seconds", SECONDS))


def square_metres(text: str) -> float:
    """Read an area in m2.

    Raises
    ------
    click.BadParameter
        If it is not a finite number above 0.
    """
    return _positive(text, _number(text, "number of m2", SQUARE_METRES))


def depth_metres(text: str) -> float:
    """Read a depth in metres of its medium, of any sign: which depths there are is the library's to say.

    Raises
    ------
    click.BadParameter
        If it is no number.
    """
    if not _meant(text, METRES) and (in_water := _meant(text, OF_WATER)):
        water, rock = _shortest(in_water[0]), f"{in_water[0] / ROCK:.5g}"
        raise click.BadParameter(f"{text} is no number of metres: write {water} for water, {rock} for rock")
    return metres(text)


def metres(text: str) -> float:
    """Read a length in metres, of any sign.

    Raises
    ------
    click.BadParameter
        If it is no number.
    """
    return _number(text, "number of metres", METRES)


def size(text: str) -> float:
    """Read a length in metres, of a target.

    Raises
    ------
    click.BadParameter
        If it is not a finite number above 0.
    """
    return _positive(text, metres(text))


def gev(text: str) -> float:
    """Read a kinetic energy in GeV; which there can be is the library's to say.

    Raises
    ------
    click.BadParameter
        If it is no number.
    """
    return _number(text, "number of GeV", GEV)


def degrees(text: str) -> float:
    """Read an angle in degrees; which there can be is the library's to say.

    Raises
    ------
    click.BadParameter
        If it is no number.
    """
    return _number(text, "number of degrees", DEGREES)


def number_from_zero(text: str) -> float:
    """Read a number of 0 or more.

    Raises
    ------
    click.BadParameter
        If it is not a finite number of 0 or more.
    """
    number = _number(text)
    if not 0 <= number < math.inf:
        raise click.BadParameter(f"{text} is not a finite number of 0 or more")
    return number


def _number(text: str, quantity: str = "number", units: Mapping[str, float] | None = None) -> float:
    try:
        return float(text)
    except ValueError as error:
        meant = " or ".join(_shortest(number) for number in _meant(text, units or {}))
        raise click.BadParameter(f"{text} is no {quantity}{f': write {meant}' if meant else ''}") from error


def _whole_number(text: str) -> int:
    try:
        return int(text)
    except ValueError as error:
        meant = ""
        if re.fullmatch("0[xX][0-9a-fA-F]+", text):
            meant = f": write {int(text, 16)}"
        elif re.fullmatch("[0-9]+(\\.0*)?([eE][0-9]{1,2})?", text):
            meant = f": write {int(Decimal(text))}"
        raise click.BadParameter(f"{text} is not a whole number{meant}") from error


def _positive(text: str, number: float) -> float:
    if not 0 < number < math.inf:
        raise click.BadParameter(f"{text} is not a finite number above 0")
    return number


def _meant(text: str, units: Mapping[str, float]) -> list[float]:
    """Return what a number with a unit or with commas may mean, the likeliest first; nothing if it is none."""
    match = re.fullmatch(r"\s*([+-]?[0-9][0-9,_]*(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)\s*(\D.*?)?\s*", text)
    if match is None:
        return []
    digits, unit = match[1], (match[2] or "").lower()
    factor = units.get(unit, units.get(unit.removesuffix("s"))) if unit else 1
    if factor is None:
        return []
    meant = dict.fromkeys(reading * factor for reading in _readings(digits.replace("_", "")))
    return [number for number in meant if math.isfinite(number)]


def _readings(digits: str) -> list[float]:
    """Return what digits with commas may mean: 1,5 is 1.5; 1,234,567 is a million; 1,234 may be either."""
    grouped = re.fullmatch("[+-]?[0-9]{1,3}(,[0-9]{3})+(\\.[0-9]+)?", digits)
    is_decimal = digits.count(",") == 1 and "." not in digits
    texts = [digits.replace(",", "")] if grouped or "," not in digits else []
    texts += [digits.replace(",", ".")] if is_decimal else []
    return [float(text) for text in texts]


def _shortest(number: float) -> str:
    """Return a number as users write it: 3600, 1e7, 0.25."""
    mantissa, _, exponent = f"{number:e}".partition("e")
    if abs(number) >= 1e5 and float(mantissa) == int(float(mantissa)):
        return f"{int(float(mantissa))}e{int(exponent)}"
    return f"{number:.15g}"
