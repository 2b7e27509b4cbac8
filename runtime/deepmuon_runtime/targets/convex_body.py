"""A convex body of a user's own."""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.targets.sphere import entry
from deepmuon_runtime.targets.target import TOLERANCE, Array, Entries, Target, checked_sizes

__all__ = ["ConvexBody"]

POINTS = 4096
"""Of the disc by which a shadow is measured where nothing better is known."""

AT_ONCE = 1 << 20  # of those points

MOST_OUTSIDE = 1e-3
"""Of the radius, by which a line may enter the body before the sphere: by rounding, where it only grazes both."""


class ConvexBody(Target):
    """A convex body that somebody else describes: derive a class that has `radius` and `path`.

    Muons are thrown at the disc of the sphere around it, and those whose line meets the body are taken. An object must
    be hashable, as a frozen dataclass of numbers is, and never change: its rate is calculated once.

    Attributes
    ----------
    name : str
        What a file calls it; the name of the class if there is none.
    radius : float
        That of a sphere around the origin that holds all of the body, in metres; the smaller, the faster.

    Examples
    --------
    The upper half of a ball, 1 m in radius and centred at its middle height:

    >>> class Dome(ConvexBody):
    ...     radius = 1.2  # of a sphere around the origin that holds all of it
    ...
    ...     def path(self, x, y, z, u, v, w):
    ...         z = z + 0.5  # from the centre of the ball
    ...         along = x * u + y * v + z * w
    ...         root = np.sqrt(along**2 - (x**2 + y**2 + z**2 - 1))  # NaN where the ball is missed
    ...         enters, leaves = -along - root, -along + root
    ...         above = -z / w  # down to the plane; all muons go down
    ...         return np.where(enters < above, enters, np.nan)
    """

    radius: float

    def __init_subclass__(cls) -> None:
        """Name a class that has no name for files."""
        super().__init_subclass__()
        cls.name = vars(cls).get("name", cls.__name__)

    @abstractmethod
    def path(self, x: Array, y: Array, z: Array, u: Array, v: Array, w: Array) -> Array:
        """Return how far it is from each place, outside the body, to where its line enters it; NaN where it never does.

        Parameters
        ----------
        x, y, z : float64 [n]
            Places on the sphere of `radius`, in metres.
        u, v, w : float64 [n]
            Directions, of length 1, w < 0.

        Returns
        -------
        float64 [n], metres
        """

    @property
    def size(self) -> tuple[float, ...]:
        """The radius of the sphere around it."""
        return (self.radius,)

    @property
    def vertical_size(self) -> float:
        """At most the sphere's."""
        return 2 * self.radius

    @property
    def largest_area(self) -> float:
        """The sphere's disc."""
        return math.pi * self.radius**2

    def projected_area(self, u: Array, v: Array, w: Array) -> Array:
        """Return the area of the shadow by 4096 points of the disc, to 1 % of it or so.

        Who knows a formula should give it, and let `exposure` return the same.
        """
        k = np.arange(POINTS)
        golden = (math.sqrt(5) - 1) / 2
        points = np.stack([np.zeros(POINTS), 2 * (k * golden % 1) - 1, (2 * k + 1) / POINTS - 1], axis=1)
        areas = [np.empty(0)]
        for first in range(0, len(w), AT_ONCE // POINTS):
            some = slice(first, first + AT_ONCE // POINTS)
            a, b, c = (np.repeat(part[some], POINTS) for part in (u, v, w))
            hits = self.enters(a, b, c, np.tile(points, (len(w[some]), 1))).hits
            areas.append(self.largest_area * hits.reshape(-1, POINTS).mean(axis=1))
        return np.concatenate(areas)

    def enters(self, u: Array, v: Array, w: Array, numbers: Array) -> Entries:
        """Throw muons at the disc of the sphere, and see which lines meet the body.

        Raises
        ------
        RefusedError
            If the radius is no finite number above 0, or a line enters the body before the sphere: it holds not all.
        """
        checked_sizes(f"a {self.name}", radius=self.radius)
        u, v, w, numbers = (part.astype(np.float64) for part in (u, v, w, numbers))
        x, y, z = (self.radius * part for part in entry(u, v, w, numbers))
        with np.errstate(invalid="ignore", divide="ignore"):
            path = np.asarray(self.path(x, y, z, u, v, w), np.float64, like=x)
        hits = np.isfinite(path)
        path = np.where(hits, path, 0.0)
        # A GPU would be waited for; the integration of the rate, on the processor, looks in any case.
        if isinstance(path, np.ndarray) and path.min(initial=0.0) < -MOST_OUTSIDE * self.radius:
            raise RefusedError(
                f"the {self.name} reaches {-path.min():.3g} m out of the sphere of {self.radius:g} m that should hold "
                "all of it: give a larger radius"
            )
        return Entries(hits, x + path * u, y + path * v, z + path * w)

    def touches(self, x: Array, y: Array, z: Array, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
        """Tell whether places are inside the sphere around it, which is all that is known without looking for them."""
        return np.asarray(x * x + y * y + z * z <= ((1 + TOLERANCE) * self.radius) ** 2)

    def exposure(self, u: Array, v: Array, w: Array, numbers: Array) -> Array:
        """Return the area of the disc where a muon hits, and 0 where not: on average the shadow."""
        return self.largest_area * self.enters(u, v, w, numbers).hits
