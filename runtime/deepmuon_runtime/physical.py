"""Whether muons are muons: no generator and no file is trusted to give none but physical ones."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import FailedError
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons

__all__ = [
    "HIGHEST_ENERGY",
    "LOWEST_ENERGY",
    "NOT_NEGATIVE_ENERGIES",
    "POSITIVE_ENERGIES",
    "Fault",
    "check_physical",
    "describe",
    "explain",
    "find_unphysical",
    "first_unphysical",
    "squared_length_tolerance",
]

LOWEST_ENERGY, HIGHEST_ENERGY = 1e-3, 1e5
"""Kinetic energies [GeV] between which muons are learned, drawn and judged: 1 MeV to 100 TeV."""

POSITIVE_ENERGIES = (float(np.finfo(np.float32).smallest_subnormal), float(np.finfo(np.float32).max))
"""The range of a kinetic energy [GeV] of which nothing is known but that it is finite and above 0."""

NOT_NEGATIVE_ENERGIES = (0.0, POSITIVE_ENERGIES[1])
"""The same where 0 may be."""

_UNBOUNDED = {
    POSITIVE_ENERGIES: "that is not finite and above 0",
    NOT_NEGATIVE_ENERGIES: "that is negative or not finite",
}

UNIT_LENGTH_TOLERANCE = 1e-6
"""How far the contract lets the length of a direction be from 1."""

# The tolerance of a length is twice that of its square; the float32 sum of squares adds its rounding.
_ROUNDING_OF_SQUARES = 5e-7


class Fault(Enum):
    """What keeps a muon from being one."""

    ENERGY = "has a kinetic energy"
    LENGTH = "has a direction whose length is not 1"
    UPWARD = "does not go down"
    CHARGE = "has a charge other than -1 and +1"


def explain(fault: Fault, energy_min_gev: float, energy_max_gev: float) -> str:
    """Return a fault in words that follow "the muon", given the range of the kinetic energy."""
    if fault is not Fault.ENERGY:
        return str(fault.value)
    outside = f"outside {np.float32(energy_min_gev):g} to {np.float32(energy_max_gev):g} GeV"
    return f"{fault.value} {_UNBOUNDED.get((energy_min_gev, energy_max_gev), outside)}"


def find_unphysical(
    muons: Muons,
    energy_min_gev: float,
    energy_max_gev: float,
    *,
    length_tolerance: float = UNIT_LENGTH_TOLERANCE,
    charge_known: bool = True,
) -> dict[Fault, NDArray[np.bool_]]:
    """Tell what is wrong with which muons.

    Parameters
    ----------
    muons
        Any number of them.
    energy_min_gev, energy_max_gev
        Range of the kinetic energy, both ends in it.
    length_tolerance
        How far the length of a direction may be from 1.
    charge_known
        Whether their charge is looked at.

    Returns
    -------
    For each fault that there is, whether a muon has it: bool [n]. What is NaN or infinite is a fault.
    """
    if not len(muons):
        return {}
    low, high = np.float32(energy_min_gev), np.float32(energy_max_gev)
    tolerance = squared_length_tolerance(length_tolerance)
    energy, w, pdg_id = muons.kinetic_energy, muons.w, muons.pdg_id
    excess = _excess_length(muons)
    # A NaN makes min and max NaN, and every comparison with NaN is false.
    if (
        energy.min() >= low
        and energy.max() <= high
        and excess.max() <= tolerance
        and w.max() < 0
        and (not charge_known or (np.abs(pdg_id) == MU_MINUS).all())
    ):
        return {}
    faults = {
        Fault.ENERGY: ~((energy >= low) & (energy <= high)),
        Fault.LENGTH: ~(excess <= tolerance),
        Fault.UPWARD: ~(w < 0),
    }
    if charge_known:
        faults[Fault.CHARGE] = (pdg_id != MU_MINUS) & (pdg_id != MU_PLUS)
    return {fault: bad for fault, bad in faults.items() if bad.any()}


def squared_length_tolerance(length_tolerance: float = UNIT_LENGTH_TOLERANCE) -> np.float32:
    """Return how far the float32 sum of a direction's squares may be from 1, given that of its length."""
    return np.float32(2 * length_tolerance + _ROUNDING_OF_SQUARES)


def _excess_length(muons: Muons) -> NDArray[np.float32]:
    """Return how far the squared length of each direction is from 1; infinite or NaN where a component is."""
    with np.errstate(over="ignore", invalid="ignore"):
        excess = muons.u * muons.u
        excess += muons.v * muons.v
        excess += muons.w * muons.w
        excess -= np.float32(1)
        np.abs(excess, out=excess)
    return excess


def describe(muons: Muons, index: int) -> str:
    """Return the numbers of one muon, for an error."""
    direction = ", ".join(f"{column[index]:g}" for column in (muons.u, muons.v, muons.w))
    return f"kinetic energy {muons.kinetic_energy[index]:g} GeV, direction {direction}"


def first_unphysical(
    muons: Muons,
    energy_min_gev: float,
    energy_max_gev: float,
    *,
    length_tolerance: float = UNIT_LENGTH_TOLERANCE,
    charge_known: bool = True,
) -> tuple[int, str] | None:
    """Return the position of the first muon with a fault of `find_unphysical`, and its fault and numbers in words.

    None if there is no such muon. The parameters are those of `find_unphysical`.
    """
    faults = find_unphysical(
        muons, energy_min_gev, energy_max_gev, length_tolerance=length_tolerance, charge_known=charge_known
    )
    if not faults:
        return None
    found = [(int(np.argmax(bad)), fault) for fault, bad in faults.items()]
    index, fault = min(found, key=lambda first: first[0])
    return index, f"{explain(fault, energy_min_gev, energy_max_gev)} ({describe(muons, index)})"


def check_physical(muons: Muons, energy_min_gev: float, energy_max_gev: float, first: int = 0) -> None:
    """Raise an error that names the first muon that can't be.

    Parameters
    ----------
    muons, energy_min_gev, energy_max_gev
        As for `find_unphysical`.
    first
        Number of the first of these muons.

    Raises
    ------
    FailedError
        If one has a fault of `find_unphysical`.
    """
    bad = first_unphysical(muons, energy_min_gev, energy_max_gev)
    if bad is not None:
        raise FailedError(f"the model gave a bad muon: number {first + bad[0]} {bad[1]}")
