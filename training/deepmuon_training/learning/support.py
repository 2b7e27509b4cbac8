"""Where the muons of a sample can be at all, which its generator keeps exactly."""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, cos, degrees, radians

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY

__all__ = ["Stated", "Support", "outermost"]

_STEEPEST_ENERGY, _STEEPEST_ZENITH = 8.0, 25.0
"""Exponents of a power law beyond which an end is a cut. Natural spectra end with 1 to 4, and cos zenith with 2 to 4;
under kilometres of rock, where few muons come slanting, with 15."""

_TAIL_MUONS = 1000
_LARGEST_TAIL = 1 / 60
"""No tail takes a larger share of the sample."""


def outermost(number: int) -> int:
    """Return how many muons of a sample of `number` make a tail, by which its end is judged."""
    return min(_TAIL_MUONS, int(_LARGEST_TAIL * number))


@dataclass(frozen=True)
class Stated:
    """What is known of a sample's support beforehand; None for what its muons shall tell.

    Parameters
    ----------
    energy_min, energy_max : float or None
        Kinetic energy [GeV].
    zenith_max : float or None
        Degrees.
    """

    energy_min: float | None = None
    energy_max: float | None = None
    zenith_max: float | None = None


@dataclass(frozen=True)
class Support:
    """The least and the most that a muon can have.

    Parameters
    ----------
    energy_min, energy_max : float
        Kinetic energy [GeV]; 1 MeV and 100 TeV where nothing cuts the spectrum.
    cos_zenith_min : float
        0 where muons come from everywhere above.
    charge : int or None
        The one that all have; None where both are.
    """

    energy_min: float = LOWEST_ENERGY
    energy_max: float = HIGHEST_ENERGY
    cos_zenith_min: float = 0.0
    charge: int | None = None

    @property
    def zenith_max(self) -> float:
        """Largest zenith angle in degrees."""
        return degrees(acos(min(self.cos_zenith_min, 1.0)))

    @classmethod
    def of(cls, muons: Muons, stated: Stated | None = None) -> Support:
        """Find the support of a sample.

        What is not stated is read from the outermost muons of each end, a thousand of a large sample. Where they
        crowd as only a very steep power law would have them, the end is a cut, made by a source that was truncated,
        and lies at the last muon. Elsewhere the spectrum goes on.

        Raises
        ------
        RefusedError
            If a muon lies outside of what is stated.
        """
        stated = stated or Stated()
        energy, cos_zenith = muons.kinetic_energy.astype(np.float64), muons.cos_zenith.astype(np.float64)
        _check_stated(energy, cos_zenith, stated)
        charges = np.unique(muons.charge)
        lowest, highest = _cut(energy, _STEEPEST_ENERGY), _cut(1 / energy, _STEEPEST_ENERGY)
        flattest = _cut(cos_zenith, _STEEPEST_ZENITH)
        return cls(
            energy_min=_first(stated.energy_min, lowest, LOWEST_ENERGY),
            energy_max=_first(stated.energy_max, None if highest is None else 1 / highest, HIGHEST_ENERGY),
            cos_zenith_min=_first(
                None if stated.zenith_max is None else cos(radians(stated.zenith_max)), flattest, 0.0
            ),
            charge=int(charges[0]) if len(charges) == 1 else None,
        )

    @property
    def note(self) -> str | None:
        """Say where the sample ends, for the generator's card; None where nothing cuts it."""
        cuts = [
            *([f"kinetic energies from {self.energy_min:g} GeV on"] if self.energy_min > LOWEST_ENERGY else []),
            *([f"kinetic energies up to {self.energy_max:g} GeV"] if self.energy_max < HIGHEST_ENERGY else []),
            *([f"zenith angles up to {self.zenith_max:.4g} degrees"] if self.cos_zenith_min > 0 else []),
            *([f"mu{'+' if self.charge > 0 else '-'} alone"] if self.charge is not None else []),
        ]
        return f"The training sample is of {', '.join(cuts)}, and so is every muon of this generator." if cuts else None


def _cut(values: NDArray[np.float64], steepest: float) -> float | None:
    """Return the least of positive values [n] if their exponent there is above `steepest`, else None.

    The exponent is B. M. Hill's estimate (Ann. Stat. 3 (1975) 1163) from the outermost values.
    """
    count = outermost(len(values))
    ordered = np.partition(values, count)
    mean_log = float(np.mean(np.log(ordered[count] / ordered[:count])))
    return float(ordered[:count].min()) if mean_log < 1 / steepest else None


def _first(*values: float | None) -> float:
    """Return the first that there is."""
    return next(value for value in values if value is not None)


def _check_stated(energy: NDArray[np.float64], cos_zenith: NDArray[np.float64], stated: Stated) -> None:
    """Refuse muons outside of what is stated, within the rounding of float32."""
    zenith_max = 90.0 if stated.zenith_max is None else stated.zenith_max
    for what, unit, outside, limit in (
        ("kinetic energy", "GeV", energy < np.float32(stated.energy_min or 0), stated.energy_min),
        ("kinetic energy", "GeV", energy > np.float32(stated.energy_max or np.inf), stated.energy_max),
        ("zenith angle", "degrees", cos_zenith < cos(radians(zenith_max)) - 1e-7, stated.zenith_max),
    ):
        if outside.any():
            first = int(np.argmax(outside))
            value = energy[first] if unit == "GeV" else degrees(acos(min(1.0, cos_zenith[first])))
            raise RefusedError(
                f"muon number {first} has a {what} of {value:g} {unit}, outside of the {limit:g} {unit} that were "
                f"stated; so have {np.mean(outside):.2%} of the muons"
            )
