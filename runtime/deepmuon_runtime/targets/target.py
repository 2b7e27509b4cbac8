"""What a target is: a plane or a convex body, centred on the origin, z up, sizes in metres."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from numbers import Real
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError

__all__ = ["TOLERANCE", "Array", "Entries", "Target", "checked_sizes"]

Array = NDArray[Any]
"""Floating-point numbers [n]."""

TOLERANCE = 1e-5
"""How far a place of float32 may be from a surface, in sizes of the target."""


class Entries(NamedTuple):
    """Which muons hit a target, bool [n], and where: x, y and z [n] in metres, of no meaning for those that miss it."""

    hits: NDArray[np.bool_]
    x: Array
    y: Array
    z: Array


class Target(ABC):
    """A plane or a body, all of whose muons are wanted, and no others.

    Directions (u, v, w) are those of motion, of length 1, z up, and w < 0: arrays [n] of any floating-point type. Those
    of `enters` may be CuPy's: numpy's functions on them call CuPy's, and it makes no arrays but by such functions.

    Attributes
    ----------
    name : str
        What a file calls it: "box".
    surface : int
        Whose flux it takes: 0 is that through a horizontal plane, 1 that through a sphere.
    rejects : bool
        Whether `enters` lets any muon miss it.
    """

    name: ClassVar[str]
    surface: ClassVar[int] = 1
    rejects: ClassVar[bool] = True

    @property
    @abstractmethod
    def size(self) -> tuple[float, ...]:
        """The numbers that make it, in metres, for the file."""

    @property
    @abstractmethod
    def vertical_size(self) -> float:
        """From its foot to its top, in metres."""

    @property
    @abstractmethod
    def largest_area(self) -> float:
        """The area [m2] to which a muon's chance of being taken is relative: no projected area is larger."""

    @abstractmethod
    def projected_area(self, u: Array, v: Array, w: Array) -> Array:
        """Return the area of its shadow across each direction, in m2."""

    @abstractmethod
    def enters(self, u: Array, v: Array, w: Array, numbers: Array) -> Entries:
        """Put muons on the target: each hits it with the probability `projected_area / largest_area`.

        Those that hit enter anywhere on the shadow alike.

        Parameters
        ----------
        u, v, w
            Directions.
        numbers : float32 [n, 3]
            Independent uniform numbers inside (-1, 1).
        """

    @abstractmethod
    def touches(self, x: Array, y: Array, z: Array, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
        """Tell whether places are on its surface, where muons of these directions come in; to float32 rounding."""

    def exposure(self, u: Array, v: Array, w: Array, numbers: Array) -> Array:
        """Return the area [m2] that turns the flux of its surface into muons of these directions that hit it.

        Parameters
        ----------
        u, v, w, numbers
            As for `enters`. Only the mean over `numbers` need be right.
        """
        return self.projected_area(u, v, w)


def checked_sizes(what: str, **sizes: float) -> None:
    """Raise RefusedError unless all sizes of a target are finite numbers above 0.

    Parameters
    ----------
    what
        Begins the error: "a box".
    sizes
        In metres, by name.
    """
    for name, size in sizes.items():
        if not isinstance(size, Real) or isinstance(size, bool) or not 0 < size < math.inf:
            raise RefusedError(f"the {name} of {what} is {size!r} m, and should be a finite number above 0")
        if not 1e-6 <= size <= 1e6:
            raise RefusedError(f"the {name} of {what} is {size:g} m, and should be from 1e-6 to 1e6 m")
