"""The flux of EcoMug: a smooth truth to test against.

D. Pagano, G. Bonomi et al., "EcoMug: An Efficient COsmic MUon Generator for cosmic-ray muon
applications", NIM A 1014 (2021) 165732.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY
from deepmuon_training.fluxes import plane
from deepmuon_training.fluxes.flux import CHARGE_RATIO, MUON_MASS, Flux, momentum, of_one_charge_ratio
from deepmuon_training.fluxes.sampler import PlaneSampler

__all__ = ["ecomug", "intensity", "plane_rate", "sea_level_muons", "zenith_exponent"]

Float = NDArray[np.float64]


def zenith_exponent(momentum: ArrayLike) -> Float:
    """Exponent n of the intensity's (cos zenith)^n at a momentum [GeV/c]."""
    return np.maximum(0.1, 2.856 - 0.655 * np.log(np.asarray(momentum, dtype=np.float64)))


def intensity(momentum: ArrayLike, cos_zenith: ArrayLike) -> Float:
    """Differential intensity J [1/(m2 s sr GeV/c)] at momentum p [GeV/c] and zenith angle.

    J = 1600 (p + 2.68)^-3.175 p^0.279 cos(zenith)^n(p), the parametrisation of EcoMug. The flux through a
    horizontal plane is J cos(zenith).
    """
    p = np.asarray(momentum, dtype=np.float64)
    return 1600.0 * (p + 2.68) ** -3.175 * p**0.279 * np.asarray(cos_zenith) ** zenith_exponent(p)


def _by_energy(energy: Float, cos_zenith: Float) -> Float:
    p = momentum(energy)
    return intensity(p, cos_zenith) * (energy + MUON_MASS) / p  # dp/dE


def ecomug(charge_ratio: float = CHARGE_RATIO) -> Flux:
    """Return the flux with so many mu+ for each mu-, since the formula knows no charge; to 100 TeV.

    EcoMug itself stops at 1 TeV unless told otherwise.
    """
    origin = "parametric flux of EcoMug (NIM A 1014 (2021) 165732)"
    return of_one_charge_ratio("ecomug", origin, _by_energy, charge_ratio, HIGHEST_ENERGY)


def plane_rate(minimum: float = LOWEST_ENERGY, maximum: float = HIGHEST_ENERGY) -> float:
    """Rate through a horizontal plane [Hz/m2] between two kinetic energies [GeV]."""
    return plane.plane_rate(ecomug(), minimum, maximum)


@lru_cache(maxsize=4)
def _sampler(charge_ratio: float, minimum: float, maximum: float) -> PlaneSampler:
    return PlaneSampler(ecomug(charge_ratio), minimum, maximum)


def sea_level_muons(
    n: int,
    *,
    seed: int | Sequence[int],
    charge_ratio: float = CHARGE_RATIO,
    minimum: float = LOWEST_ENERGY,
    maximum: float = HIGHEST_ENERGY,
) -> Muons:
    """Draw n independent muons crossing a horizontal plane at sea level.

    Parameters
    ----------
    n
        How many.
    seed
        Seed of NumPy's default generator.
    charge_ratio
        mu+ for each mu-, the same at all energies and angles.
    minimum, maximum
        Range of the kinetic energy [GeV].
    """
    return _sampler(charge_ratio, minimum, maximum).draw(n, seed)
