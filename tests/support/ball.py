"""A body that somebody describes: a sphere in a larger one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deepmuon_runtime import ConvexBody

__all__ = ["Ball"]


@dataclass(frozen=True)
class Ball(ConvexBody):
    """By functions that CuPy has too."""

    ball: float
    radius: float

    def path(self, x, y, z, u, v, w):
        along = x * u + y * v + z * w
        under_root = along**2 - (x**2 + y**2 + z**2 - self.ball**2)
        return np.where(under_root >= 0, -along - np.sqrt(under_root), np.nan)
