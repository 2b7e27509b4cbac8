"""A set of muons as columns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["MU_MINUS", "MU_PLUS", "Muons"]

MU_MINUS = 13
"""PDG particle number of the negative muon."""

MU_PLUS = -13
"""PDG particle number of the positive muon."""


@dataclass(frozen=True)
class Muons:
    """Muons that cross a horizontal plane or enter a target, one array per column, all of one length n.

    Parameters
    ----------
    kinetic_energy : float32 [n]
        Kinetic energy in GeV.
    u, v, w : float32 [n]
        Direction of motion, a unit vector; z is up, so w < 0 is downward.
    pdg_id : int8 [n]
        13 for mu-, -13 for mu+.
    x, y, z : float32 [n] or None
        Where the muon crosses the plane or enters the target, in metres from its centre, z up; None where the muons
        have no place.
    time : float64 [n] or None
        When, in seconds from the beginning of the live time; None where the muons have no time.
    """

    kinetic_energy: NDArray[np.float32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    w: NDArray[np.float32]
    pdg_id: NDArray[np.int8]
    x: NDArray[np.float32] | None = None
    y: NDArray[np.float32] | None = None
    z: NDArray[np.float32] | None = None
    time: NDArray[np.float64] | None = None

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """The columns that are there, by name."""
        return {name: column for name, column in vars(self).items() if column is not None}

    @property
    def charge(self) -> NDArray[np.int8]:
        """Electric charge in e, -1 or +1: int8 [n]."""
        return -np.sign(self.pdg_id)

    @property
    def cos_zenith(self) -> NDArray[np.float32]:
        """Cosine of the zenith angle from which the muon comes, -w: float32 [n]."""
        return -self.w

    def __len__(self) -> int:
        """Return the number of muons."""
        return len(self.kinetic_energy)

    def __getitem__(self, index: slice | NDArray[Any]) -> Muons:
        """Select muons by a slice (views), a mask or an array of positions (copies)."""
        return Muons(**{name: column[index] for name, column in self.columns.items()})

    @classmethod
    def empty(
        cls,
        n: int,
        *,
        has_place: bool = False,
        has_time: bool = False,
        column: Callable[[int, type], NDArray[Any]] = np.empty,
    ) -> Muons:
        """Return n muons whose columns, made by `column` of n and a type, are yet to be filled."""
        energy, u, v, w = (column(n, np.float32) for _ in range(4))
        place = {axis: column(n, np.float32) for axis in ("x", "y", "z")} if has_place else {}
        time = column(n, np.float64) if has_time else None
        return cls(energy, u, v, w, column(n, np.int8), **place, time=time)

    @classmethod
    def of(cls, kinetic_energy: ArrayLike, u: ArrayLike, v: ArrayLike, w: ArrayLike, pdg_id: ArrayLike) -> Muons:
        """Make a set from columns of any number type."""
        energy, x, y, z = (np.asarray(column, dtype=np.float32) for column in (kinetic_energy, u, v, w))
        return cls(energy, x, y, z, np.asarray(pdg_id, dtype=np.int8))

    @classmethod
    def concatenate(cls, parts: Sequence[Muons]) -> Muons:
        """Join several sets, all with the same columns, in order."""
        names = parts[0].columns
        return cls(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})
