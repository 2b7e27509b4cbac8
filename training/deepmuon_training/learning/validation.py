"""The part of a training sample that validates a fit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["split", "training_rows"]

_FRACTION = 0.05
_MOST = 500_000
"""More would not decide better, and take a few kilobytes of memory each."""


def training_rows(number: int) -> int:
    """Return how many of the first muons train: all but a twentieth, or but half a million if that is less."""
    return max(round(number * (1 - _FRACTION)), number - _MOST)


def split(*columns: NDArray[Any]) -> tuple[list[NDArray[Any]], list[NDArray[Any]]]:
    """Cut columns of one length in rows that train and rows that validate, by which a fit stops and keeps weights."""
    cut = training_rows(len(columns[0]))
    return [np.ascontiguousarray(c[:cut]) for c in columns], [np.ascontiguousarray(c[cut:]) for c in columns]
