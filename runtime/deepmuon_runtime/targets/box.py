"""An upright box."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.targets.target import TOLERANCE, Array, Entries, Target, checked_sizes

__all__ = ["Box"]


@dataclass(frozen=True)
class Box(Target):
    """A box whose edges lie along x, y and z.

    Its shadow is that of the three faces which a muon sees: X Y abs(w) + Y Z abs(u) + X Z abs(v).

    Parameters
    ----------
    x, y, z
        Its widths along x, y and z, in metres.

    Raises
    ------
    RefusedError
        If one of them is no finite number above 0.
    """

    x: float
    y: float
    z: float
    name: ClassVar[str] = "box"

    def __post_init__(self) -> None:
        """Check the sizes."""
        checked_sizes("a box", x=self.x, y=self.y, z=self.z)

    @property
    def size(self) -> tuple[float, ...]:
        """Its widths."""
        return (self.x, self.y, self.z)

    @property
    def vertical_size(self) -> float:
        """Its width along z."""
        return self.z

    @property
    def largest_area(self) -> float:
        """That of the shadow across the direction along which all three faces count most."""
        return math.hypot(*self._faces)

    @property
    def _faces(self) -> tuple[float, float, float]:
        """Areas of the faces across x, y and z."""
        return self.y * self.z, self.x * self.z, self.x * self.y

    def projected_area(self, u: Array, v: Array, w: Array) -> Array:
        """Return the sum over the three faces that are seen."""
        across_x, across_y, across_z = self._faces
        return across_x * np.abs(u) + across_y * np.abs(v) - across_z * w

    def enters(self, u: Array, v: Array, w: Array, numbers: Array) -> Entries:
        """Choose one of the faces that are seen, or none, by their shadows, and a place on it."""
        # Products with 0 and 1 are several times as fast as choices, and exact too.
        one = np.float32(1)
        share_x, share_y, share_z = (np.float32(2 * face / self.largest_area) for face in self._faces)
        left = numbers[:, 0] + one  # from 0 to 2, the whole of the largest area
        left += share_z * w
        is_top = left < 0
        left -= share_x * np.abs(u)
        on_x = (left < 0) ^ is_top
        left -= share_y * np.abs(v)
        hits = left < 0
        on_y = ~(on_x | is_top)  # or on none
        first, second = (np.ascontiguousarray(numbers[:, number], like=numbers) for number in (1, 2))
        at_x, at_y, at_top = (chosen.astype(np.float32) for chosen in (on_x, on_y, is_top))
        half_x, half_y, half_z = (np.float32(width / 2) for width in self.size)
        across = one - at_x
        z = second * across
        z += first * at_x
        z *= one - at_top
        z += at_top
        z *= half_z
        across *= first
        x = _on_face(across, half_x, at_x, u)
        across = one - at_y
        across *= second
        return Entries(hits, x, _on_face(across, half_y, at_y, v), z)

    def touches(self, x: Array, y: Array, z: Array, u: Array, v: Array, w: Array) -> NDArray[np.bool_]:
        """Tell whether places are on one of the faces that muons come in by."""
        near = TOLERANCE * max(self.size)
        is_inside, is_on_face = np.ones(len(w), bool), np.zeros(len(w), bool)
        for place, along, half in ((x, u, self.x / 2), (y, v, self.y / 2), (z, w, self.z / 2)):
            is_inside &= np.abs(place) <= half + near
            is_on_face |= (np.abs(place + np.copysign(half, along)) <= near) & (along != 0)
        return is_inside & is_on_face


def _on_face(across: Array, half: np.float32, is_there: Array, along: Array) -> Array:
    """Return half a width times where muons cross it, or, where they come in by its face, the end they come from."""
    across *= half
    end = (along < 0).astype(np.float32)
    end *= 2 * half
    end -= half
    end *= is_there
    across += end
    return across
