"""Which muons are wanted: bounds of their kinetic energy and zenith angle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons

__all__ = ["NO_CUTS", "Cuts"]


@dataclass(frozen=True)
class Cuts:
    """Bounds of muons, both ends within; None where there is none.

    Parameters
    ----------
    energy_min, energy_max
        Kinetic energy in GeV.
    zenith_min, zenith_max
        Zenith angle in degrees, 0 to 90: 0 is straight from above.

    Raises
    ------
    RefusedError
        If nothing is between them, or one is none of the numbers that it can be.
    """

    energy_min: float | None = None
    energy_max: float | None = None
    zenith_min: float | None = None
    zenith_max: float | None = None

    def __post_init__(self) -> None:
        """Check the bounds."""
        for name, most, unit in (("energy", math.inf, "GeV"), ("zenith", 90.0, "degrees")):
            bounds = {f"{name} {end}": getattr(self, f"{name}_{end}") for end in ("min", "max")}
            for what, bound in bounds.items():
                if bound is None:
                    continue
                if not isinstance(bound, Real) or isinstance(bound, bool):
                    raise RefusedError(f"{bound!r} is no {what}: give a number of {unit}")
                if not 0 <= float(bound) <= most or bound == math.inf:
                    said = "a finite number from 0 on" if most == math.inf else f"from 0 to {most:g}"
                    raise RefusedError(f"the {what} is {bound:g} {unit}, and should be {said}")
            low, high = bounds.values()
            if low is not None and high is not None and not low < high:
                raise RefusedError(
                    f"no muon is left: the {name} min, {low:g} {unit}, is not below the {name} max, {high:g} {unit}"
                )
        if self.zenith_min == 90:
            raise RefusedError("no muon is left: none comes from a zenith angle of 90 degrees or more")
        if self.zenith_max == 0:
            raise RefusedError("no muon is left: the zenith max is 0 degrees, and should be above")
        low32, high32 = self.energies
        if not low32 <= high32:
            raise RefusedError(f"no muon is left: no float32 is from {self.energy_min!r} to {self.energy_max!r} GeV")

    def __bool__(self) -> bool:
        """Whether there are any."""
        return self != NO_CUTS

    @property
    def cut_zenith(self) -> bool:
        """Whether the zenith angle has bounds."""
        return self.zenith_min is not None or self.zenith_max is not None

    @property
    def cut_energy(self) -> bool:
        """Whether the energy has bounds."""
        return self.energy_min is not None or self.energy_max is not None

    @property
    def energies(self) -> tuple[np.float32, np.float32]:
        """The lowest and the highest float32 energy that is within the bounds."""
        low = 0.0 if self.energy_min is None else self.energy_min
        high = math.inf if self.energy_max is None else self.energy_max
        return _inward(low, high)

    @property
    def cos_zeniths(self) -> tuple[np.float32, np.float32]:
        """The same of cos zenith; 1 and a rounding more from straight above."""
        low = 0.0 if self.zenith_max is None else math.cos(math.radians(self.zenith_max))
        high = math.inf if not self.zenith_min else math.cos(math.radians(self.zenith_min))
        return _inward(low, high)

    def keeps(self, muons: Muons, rounding: float = 0.0) -> NDArray[np.bool_]:
        """Tell which muons are within all bounds: bool [n].

        Parameters
        ----------
        muons
            Any number of them.
        rounding
            How far energies and cos zenith may be from what they were, relative.
        """
        kept = np.ones_like(muons.kinetic_energy, bool)
        if self.cut_energy:
            _cut(kept, muons.kinetic_energy, self.energies, rounding)
        if self.cut_zenith:
            _cut(kept, muons.cos_zenith, self.cos_zeniths, rounding)
        return kept

    @property
    def attributes(self) -> dict[str, float]:
        """What a file says of them."""
        named = {
            "energy_min_gev": self.energy_min,
            "energy_max_gev": self.energy_max,
            "zenith_min_degrees": self.zenith_min,
            "zenith_max_degrees": self.zenith_max,
        }
        return {name: float(bound) for name, bound in named.items() if bound is not None}


def _cut(
    kept: NDArray[np.bool_], column: NDArray[np.float32], bounds: tuple[np.float32, np.float32], rounding: float
) -> None:
    """Take out what is outside the bounds."""
    low, high = bounds
    if low > 0:
        kept &= column >= low * np.float32(1 - rounding)
    if high < np.inf:
        kept &= column <= high * np.float32(1 + rounding)


def _inward(low: float, high: float) -> tuple[np.float32, np.float32]:
    """Return the lowest and the highest float32 that are really from one number to the other."""
    with np.errstate(over="ignore"):
        least, most = np.float32(low), np.float32(high)
    if float(least) < low:
        least = np.nextafter(least, np.float32(np.inf))
    if float(most) > high:
        most = np.nextafter(most, np.float32(-np.inf))
    return least, most


NO_CUTS = Cuts()
"""All muons."""
