"""An upright cylinder."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.targets.target import TOLERANCE, Array, Entries, Target, checked_sizes

__all__ = ["Cylinder"]


@dataclass(frozen=True)
class Cylinder(Target):
    """A cylinder whose axis is z.

    Its shadow is that of its top and its side: pi R^2 abs(w) + 2 R H sin zenith.

    Parameters
    ----------
    radius, height
        Its radius, and its height along z, in metres.

    Raises
    ------
    RefusedError
        If one of them is no finite number above 0.
    """

    radius: float
    height: float
    name: ClassVar[str] = "cylinder"

    def __post_init__(self) -> None:
        """Check the sizes."""
        checked_sizes("a cylinder", radius=self.radius, height=self.height)

    @property
    def size(self) -> tuple[float, ...]:
        """Its radius and its height."""
        return (self.radius, self.height)

    @property
    def vertical_size(self) -> float:
        """Its height."""
        return self.height

    @property
    def largest_area(self) -> float:
        """That of the shadow across the direction along which top and side count most."""
        return math.hypot(self._top, self._side)

    @property
    def _top(self) -> float:
        return math.pi * self.radius**2

    @property
    def _side(self) -> float:
        """The area of its shadow from the side."""
        return 2 * self.radius * self.height

    def projected_area(self, u: Array, v: Array, w: Array) -> Array:
        """Return the sum of top and side."""
        return np.asarray(self._side * np.sqrt(u * u + v * v) - self._top * w)

    def enters(self, u: Array, v: Array, w: Array, numbers: Array) -> Entries:
        """Choose the top, the side, or none, by their shadows, and a place there."""
        radius, half = np.float32(self.radius), np.float32(self.height / 2)
        share_top, share_side = (np.float32(2 * area / self.largest_area) for area in (self._top, self._side))
        sine = np.sqrt(u * u + v * v)
        left = numbers[:, 0] + np.float32(1)  # from 0 to 2, the whole of the largest area
        left += share_top * w
        is_top = left < 0
        left -= share_side * sine
        # On the top uniform on the disc; on the side uniform across the direction, which is `along` there.
        turn = np.float32(math.pi) * numbers[:, 1]
        away = radius * np.sqrt(np.float32(0.5) * numbers[:, 2] + np.float32(0.5))
        along = np.float32(1) / np.maximum(sine, np.float32(1e-30))  # 0 / 1e-30 is 0 where a muon comes straight down
        along_x, along_y = u * along, v * along
        across = radius * numbers[:, 1]
        depth = np.sqrt((radius - across) * (radius + across))
        # Products with 0 and 1 are several times as fast as choices, and exact too.
        on_top = is_top.astype(np.float32)
        on_side = np.float32(1) - on_top
        return Entries(
            left < 0,
            away * np.cos(turn) * on_top - (across * along_y + depth * along_x) * on_side,
            away * np.sin(turn) * on_top + (across * along_x - depth * along_y) * on_side,
            half * (on_top + numbers[:, 2] * on_side),
        )

    def touches(self, x: Array, y: Array, z: Array, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
        """Tell whether places are on the top, or on the part of the side that muons come in by."""
        near = TOLERANCE * max(self.size)
        away = np.hypot(x, y)
        is_on_top = (np.abs(z - self.height / 2) <= near) & (away <= self.radius + near)
        is_on_side = (np.abs(away - self.radius) <= near) & (np.abs(z) <= self.height / 2 + near)
        return np.asarray(is_on_top | is_on_side & (x * u + y * v <= near))
