"""Whether muons are muons: no generator is trusted to give none but physical ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import FailedError
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons

__all__ = ["POSITIVE_ENERGIES", "check_physical", "describe", "find_unphysical"]

POSITIVE_ENERGIES = (float(np.finfo(np.float32).smallest_subnormal), float(np.finfo(np.float32).max))
"""The range of a kinetic energy of which nothing is known but that it is finite and above 0."""

# The contract's 1e-6 on the length is twice that on its square; the float32 sum of squares adds its rounding.
SQUARED_LENGTH_TOLERANCE = np.float32(2e-6 + 5e-7)


def find_unphysical(muons: Muons, energy_min_gev: float, energy_max_gev: float) -> dict[str, NDArray[np.bool_]]:
    """Tell what is wrong with which muons.

    Parameters
    ----------
    muons
        At least one.
    energy_min_gev, energy_max_gev
        Range of the kinetic energy.

    Returns
    -------
    For each fault that there is, whether a muon has it: bool [n]. The faults are a kinetic energy that is not finite
    or out of range, a direction that has not unit length (to 1e-6) or is not downward, and a particle that is no muon.
    """
    low, high = np.float32(energy_min_gev), np.float32(energy_max_gev)
    energy, w, pdg_id = muons.kinetic_energy, muons.w, muons.pdg_id
    excess = _excess_length(muons)
    # A NaN makes min and max NaN, and every comparison with NaN is false.
    if (
        energy.min() >= low
        and energy.max() <= high
        and excess.max() <= SQUARED_LENGTH_TOLERANCE
        and w.max() < 0
        and (np.abs(pdg_id) == MU_MINUS).all()
    ):
        return {}
    is_known = (energy_min_gev, energy_max_gev) != POSITIVE_ENERGIES
    bad_energy = f"outside {low:g} to {high:g} GeV" if is_known else "that is not finite and above 0"
    faults = {
        f"has a kinetic energy {bad_energy}": ~((energy >= low) & (energy <= high)),
        "has a direction whose length is not 1": ~(excess <= SQUARED_LENGTH_TOLERANCE),
        "does not go down": ~(w < 0),
        "has a charge other than -1 and +1": (pdg_id != MU_MINUS) & (pdg_id != MU_PLUS),
    }
    return {fault: bad for fault, bad in faults.items() if bad.any()}


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
    faults = find_unphysical(muons, energy_min_gev, energy_max_gev)
    if not faults:
        return
    index, fault = min((int(np.argmax(bad)), fault) for fault, bad in faults.items())
    raise FailedError(f"the model gave a bad muon: number {first + index} {fault} ({describe(muons, index)})")
