"""A sphere."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.targets.target import TOLERANCE, Array, Entries, Target, checked_sizes

__all__ = ["Sphere", "entry"]


@dataclass(frozen=True)
class Sphere(Target):
    """A sphere, whose shadow is a disc of its radius from everywhere.

    Parameters
    ----------
    radius
        Its radius in metres.

    Raises
    ------
    RefusedError
        If it is no finite number above 0.
    """

    radius: float
    name: ClassVar[str] = "sphere"
    rejects: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the radius."""
        checked_sizes("a sphere", radius=self.radius)

    @property
    def size(self) -> tuple[float, ...]:
        """Its radius."""
        return (self.radius,)

    @property
    def vertical_size(self) -> float:
        """Its diameter."""
        return 2 * self.radius

    @property
    def largest_area(self) -> float:
        """That of the disc."""
        return math.pi * self.radius**2

    def projected_area(self, u: Array, v: Array, w: Array) -> Array:
        """Return the area of the disc for each direction."""
        return np.full(len(w), self.largest_area)

    def enters(self, u: Array, v: Array, w: Array, numbers: Array) -> Entries:
        """Put all muons on it, uniform on the disc across their directions."""
        radius = np.float32(self.radius)
        x, y, z = (radius * part for part in entry(u, v, w, numbers))
        return Entries(np.ones_like(w, bool), x, y, z)

    def touches(self, x: Array, y: Array, z: Array, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
        """Tell whether places are on the half that muons come in by."""
        near = TOLERANCE * self.radius
        is_on = np.abs(np.sqrt(x * x + y * y + z * z) - self.radius) <= near
        return np.asarray(is_on & (x * u + y * v + z * w <= near))


def entry(u: Array, v: Array, w: Array, numbers: Array) -> tuple[Array, Array, Array]:
    """Return where muons enter the unit sphere, uniform on its shadow; the parameters are those of `disc`."""
    x, y, z = disc(u, v, w, numbers)
    back = np.sqrt(np.maximum(np.float32(0), np.float32(1) - (x * x + y * y + z * z)))
    return x - back * u, y - back * v, z - back * w


def disc(u: Array, v: Array, w: Array, numbers: Array) -> tuple[Array, Array, Array]:
    """Return uniform places on the unit disc across each direction.

    With two axes across it, which are those of J. Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6
    (2017) 1, for w < 0.

    Parameters
    ----------
    u, v, w
        Directions [n].
    numbers : float32 [n, 3]
        Uniform numbers inside (-1, 1), of which the last two are taken.
    """
    away = np.sqrt(np.float32(0.5) * numbers[:, 2] + np.float32(0.5))
    turn = np.float32(math.pi) * numbers[:, 1]
    first, second = away * np.cos(turn), away * np.sin(turn)
    a = np.float32(1) / (np.float32(1) - w)
    b = -u * v * a
    return (
        first * (np.float32(1) - u * u * a) + second * b,
        first * b + second * (np.float32(1) - v * v * a),
        first * u + second * v,
    )
