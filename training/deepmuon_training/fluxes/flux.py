"""What a flux of muons at sea level is to the sampler, the quadrature and the commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deepmuon_runtime.physical import LOWEST_ENERGY

__all__ = ["CHARGE_RATIO", "FLUX_END", "MUON_MASS", "Flux", "Intensity", "momentum", "of_one_charge_ratio"]

MUON_MASS = 0.1056583755
"""Mass of the muon [GeV], Particle Data Group 2024."""

CHARGE_RATIO = 1.28
"""mu+ for each mu-, if a formula knows no charge: CMS's near 10 GeV, about (Phys. Lett. B 692 (2010) 83)."""

FLUX_END = 1e6
"""Kinetic energy [GeV] up to which formulas are used, 1 PeV: hardly a muon five kilometres deep began above."""

Float = NDArray[np.float64]
Intensity = Callable[[Float, Float], tuple[Float, Float]]
"""J of mu+ and of mu- [1/(m2 s sr GeV)], given kinetic energy [GeV] and cos zenith from 0 to 1, which broadcast."""


@dataclass(frozen=True)
class Flux:
    """Muons per m2 across their direction, second, steradian and GeV of kinetic energy, the same at all azimuths.

    Parameters
    ----------
    name : str
        What a command calls it.
    origin : str
        Whose it is, for a file's `source`.
    intensity : Intensity
        J of both charges, finite and not negative, above 0 for one of them at least. The flux through a horizontal
        plane is J cos(zenith).
    energy_min, energy_max : float
        Kinetic energies [GeV] between which it is known.
    charges : str
        Where its charges are from, for a file's `provenance`.
    """

    name: str
    origin: str
    intensity: Intensity
    energy_min: float = LOWEST_ENERGY
    energy_max: float = FLUX_END
    charges: str = "charges of the flux"


def momentum(kinetic_energy: ArrayLike) -> Float:
    """Momentum [GeV/c] of a muon of a kinetic energy [GeV]."""
    energy = np.asarray(kinetic_energy, dtype=np.float64)
    return np.sqrt(energy * (energy + 2 * MUON_MASS))


def of_one_charge_ratio(
    name: str, origin: str, total: Callable[[Float, Float], Float], charge_ratio: float, energy_max: float = FLUX_END
) -> Flux:
    """Return the flux of a formula that knows no charge, with so many mu+ for each mu- at all energies and angles."""

    def intensity(energy: Float, cos_zenith: Float) -> tuple[Float, Float]:
        both = total(energy, cos_zenith)
        return both * (charge_ratio / (1 + charge_ratio)), both / (1 + charge_ratio)

    return Flux(name, origin, intensity, energy_max=energy_max, charges=f"{charge_ratio:g} mu+ for each mu-")
