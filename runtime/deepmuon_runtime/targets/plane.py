"""A horizontal rectangle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.targets.target import TOLERANCE, Array, Entries, Target, checked_sizes

__all__ = ["Plane"]


@dataclass(frozen=True)
class Plane(Target):
    """A horizontal rectangle at z = 0, which muons cross downwards.

    Parameters
    ----------
    x, y
        Its widths along x and y, in metres.

    Raises
    ------
    RefusedError
        If one of them is no finite number above 0.
    """

    x: float
    y: float
    name: ClassVar[str] = "plane"
    surface: ClassVar[int] = 0
    rejects: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the sizes."""
        checked_sizes("a plane", x=self.x, y=self.y)

    @property
    def size(self) -> tuple[float, ...]:
        """Its widths."""
        return (self.x, self.y)

    @property
    def vertical_size(self) -> float:
        """It has none."""
        return 0.0

    @property
    def largest_area(self) -> float:
        """The area itself."""
        return self.x * self.y

    def projected_area(self, u: Array, v: Array, w: Array) -> Array:
        """Return the area times cos zenith."""
        return -self.largest_area * w

    def enters(self, u: Array, v: Array, w: Array, numbers: Array) -> Entries:
        """Put all muons on it: the flux through a horizontal plane has the factor cos zenith already."""
        x = np.float32(self.x / 2) * numbers[:, 0]
        y = np.float32(self.y / 2) * numbers[:, 1]
        return Entries(np.ones_like(w, bool), x, y, np.zeros_like(x))

    def touches(self, x: Array, y: Array, z: Array, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
        """Tell whether places are on the rectangle."""
        near = TOLERANCE * max(self.size)
        return (np.abs(x) <= self.x / 2 + near) & (np.abs(y) <= self.y / 2 + near) & (np.abs(z) <= near)

    def exposure(self, u: Array, v: Array, w: Array, numbers: Array) -> Array:
        """Return the area itself: its flux has the factor cos zenith."""
        return np.full(len(w), self.largest_area)
