"""Whether muons are muons: no generator is trusted to give none but physical ones."""

from __future__ import annotations

import numpy as np

from deepmuon_runtime.errors import FailedError
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons

__all__ = ["check_physical"]

# The contract's 1e-6 on the length is twice that on its square; the float32 sum of squares adds its rounding.
SQUARED_LENGTH_TOLERANCE = np.float32(2e-6 + 5e-7)


def check_physical(muons: Muons, energy_min_gev: float, energy_max_gev: float, first: int = 0) -> None:
    """Raise an error that names the first muon that can't be.

    Parameters
    ----------
    muons
        At least one.
    energy_min_gev, energy_max_gev
        Range of the kinetic energy.
    first
        Number of the first of these muons.

    Raises
    ------
    FailedError
        If a kinetic energy is not finite or out of range, a direction has not unit length (to 1e-6) or is not
        downward, or a particle is no muon.
    """
    low, high = np.float32(energy_min_gev), np.float32(energy_max_gev)
    energy, u, v, w, pdg_id = muons.kinetic_energy, muons.u, muons.v, muons.w, muons.pdg_id
    excess = u * u
    excess += v * v
    excess += w * w
    excess -= np.float32(1)
    np.abs(excess, out=excess)
    # A NaN makes min and max NaN, and every comparison with NaN is false.
    if (
        energy.min() >= low
        and energy.max() <= high
        and excess.max() <= SQUARED_LENGTH_TOLERANCE
        and w.max() < 0
        and (np.abs(pdg_id) == MU_MINUS).all()
    ):
        return
    faults = {
        f"has a kinetic energy outside {low:g} to {high:g} GeV": ~((energy >= low) & (energy <= high)),
        "has a direction whose length is not 1": ~(excess <= SQUARED_LENGTH_TOLERANCE),
        "does not go down": ~(w < 0),
        "has a charge other than -1 and +1": (pdg_id != MU_MINUS) & (pdg_id != MU_PLUS),
    }
    index, fault = min((int(np.argmax(bad)), fault) for fault, bad in faults.items() if bad.any())
    raise FailedError(
        f"the model gave a bad muon: number {first + index} {fault} (kinetic energy {energy[index]:g} GeV, "
        f"direction {u[index]:g}, {v[index]:g}, {w[index]:g})"
    )
