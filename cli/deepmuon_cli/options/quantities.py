"""Numbers as users write them: types of click options."""

from __future__ import annotations

import math
from decimal import Decimal, InvalidOperation
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from deepmuon_runtime import Shard

__all__ = ["muon_number", "number_from_zero", "positive_number", "seed_number", "shard_number"]


def muon_number(text: str) -> int:
    """Read a number of muons, exact however it is written: 1000, 1e7, 10_000_000.

    Raises
    ------
    click.BadParameter
        If it is no number, not whole, below 1, or above 2^53.
    """
    from deepmuon_runtime.generator import LARGEST_NUMBER

    try:
        number = Decimal(text)
    except InvalidOperation as error:
        raise click.BadParameter(f"{text} is no number: write for instance 1e7 or 10_000_000") from error
    if number.is_nan() or not 0 < number <= LARGEST_NUMBER:
        raise click.BadParameter(f"{text} muons can't be made: the number is from 1 to 2^53")
    if number != number.to_integral_value():
        raise click.BadParameter(f"{text} is not a whole number")
    return int(number)


def seed_number(text: str) -> int:
    """Read a seed.

    Raises
    ------
    click.BadParameter
        If it is not a whole number from 0 to 2^64 - 1.
    """
    from deepmuon_runtime.latents.philox import LARGEST_SEED

    try:
        seed = int(text)
    except ValueError as error:
        raise click.BadParameter(f"{text} is not a whole number") from error
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


def positive_number(text: str) -> float:
    """Read a number above 0.

    Raises
    ------
    click.BadParameter
        If it is not a finite number above 0.
    """
    number = _number(text)
    if not 0 < number < math.inf:
        raise click.BadParameter(f"{text} is not a finite number above 0")
    return number


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


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise click.BadParameter(f"{text} is no number") from error
