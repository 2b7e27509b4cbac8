"""The largest distance between the cumulative distributions of two samples."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

__all__ = ["KolmogorovSmirnov", "kolmogorov_smirnov"]


@dataclass(frozen=True)
class KolmogorovSmirnov:
    """A two-sample Kolmogorov-Smirnov distance and what it shows when nothing differs.

    Parameters
    ----------
    distance : float
        Largest difference of the two cumulative distributions, 0 to 1.
    mean_noise : float
        Mean distance of two samples of one distribution, 0.87 sqrt(1/n + V/m).
    one_percent_level : float
        Distance that one pair in a hundred of such samples exceeds, 1.63 sqrt(1/n + V/m).
    excess : float
        Distance minus that level; negative where nothing is seen.
    """

    distance: float
    mean_noise: float
    one_percent_level: float
    excess: float


def kolmogorov_smirnov(a: NDArray[np.floating], b: NDArray[np.floating], variance: float = 1.0) -> KolmogorovSmirnov:
    """Compare two columns, exactly and ties included; quickest with the shorter one second.

    The noise is that of independent values: draws of correlated muons show another.

    Parameters
    ----------
    a : array [n]
        One sample, in any order.
    b : array [m]
        The other.
    variance : float
        V: how many times larger than that of independent values the variance of counts of the second is.
    """
    n, m = len(a), len(b)
    a, b = np.sort(a), np.sort(b)
    # Between neighbours of b only F_a moves, and only up: the extremes lie at, or just before, values of b.
    at = np.searchsorted(a, b, side="right") / n - np.searchsorted(b, b, side="right") / m
    before = np.searchsorted(a, b, side="left") / n - np.searchsorted(b, b, side="left") / m
    distance = float(max(np.abs(at).max(), np.abs(before).max()))
    scale = sqrt(1 / n + variance / m)
    return KolmogorovSmirnov(distance, 0.87 * scale, 1.63 * scale, distance - 1.63 * scale)
