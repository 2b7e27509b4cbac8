"""The energy as a condition of angle and charge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

__all__ = ["EnergyCondition"]

_OUTERMOST = 200


@dataclass(frozen=True)
class EnergyCondition:
    """Clips the networks' energy coordinate y = x - mean and scales it to -1 .. 1.

    The 200 lowest and the 200 highest muons of a training sample each share one condition: a network would only
    invent a trend there.

    Parameters
    ----------
    low, high
        y at -1 and 1.
    """

    low: float
    high: float

    @classmethod
    def fit(cls, y: NDArray[np.float32]) -> EnergyCondition:
        """Take the range from a sample's y [n]."""
        ends = _OUTERMOST, len(y) - _OUTERMOST
        low, high = np.partition(y, ends)[list(ends)]
        return cls(float(low), float(high))

    def __call__(self, y: torch.Tensor) -> torch.Tensor:
        """Scale y of any shape."""
        return (y.clamp(self.low, self.high) - self.low) * (2 / (self.high - self.low)) - 1
