"""The part of a training sample that validates a fit."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["VALIDATION_FRACTION", "split"]

VALIDATION_FRACTION = 0.05
"""The last so much of the training sample decides when to stop and which weights to keep."""


def split(*columns: NDArray[Any]) -> tuple[list[NDArray[Any]], list[NDArray[Any]]]:
    """Cut columns of one length in those that train and those that validate."""
    cut = round(len(columns[0]) * (1 - VALIDATION_FRACTION))
    return [np.ascontiguousarray(c[:cut]) for c in columns], [np.ascontiguousarray(c[cut:]) for c in columns]
