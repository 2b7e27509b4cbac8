"""How many muons a run can have."""

from __future__ import annotations

from numbers import Real

from deepmuon_runtime.errors import RefusedError

__all__ = ["LARGEST_NUMBER", "checked_numbers"]

LARGEST_NUMBER = 2**53
"""The most muons of one run."""


def checked_numbers(n: float | None, first: float = 0) -> range:
    """Return the numbers of n muons from `first` on, or raise RefusedError where there are none."""
    for number, meaning in ((n, "number of muons"), (first, "number of a first muon")):
        if not isinstance(number, Real) or not 0 <= number <= LARGEST_NUMBER or number % 1 != 0:
            raise RefusedError(f"{number!r} is no {meaning}: a whole number from 0 to 2^53 is")
    assert n is not None
    if first + n > LARGEST_NUMBER:
        raise RefusedError(f"{n} muons from number {first} on end after number 2^53")
    return range(int(first), int(first) + int(n))
