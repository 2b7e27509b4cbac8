"""A made-up mountain: an overburden whose muons have a preferred azimuth, to try things on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import LOWEST_ENERGY

__all__ = ["behind_mountain", "rock", "skyline"]

IONISATION = 0.217
"""Energy [GeV] that a muon loses by ionisation in a metre of water equivalent, about, at 10 to 1000 GeV."""

RADIATION = 4e-4
"""Share of its energy that it loses by radiation in a metre of water equivalent of standard rock, about."""

Float = NDArray[np.float64]


def skyline(from_north: Float) -> Float:
    """Elevation [rad] of the mountain's edge, at angles [rad] from north: 60 degrees in the middle, 35 wide (sigma)."""
    elevation: Float = np.radians(60) * np.exp(-0.5 * (from_north / np.radians(35)) ** 2)
    return elevation


def rock(u: Float, v: Float, w: Float) -> Float:
    """Metres of water equivalent that muons of direction (u, v, w) have crossed; y points north.

    A hundred metres of standard rock at the foot, less towards the skyline: 265 (1 - tan elevation / tan skyline).
    """
    from_north = np.arctan2(-u, -v)  # where they come from, not where they go
    slope = -w / np.maximum(np.hypot(u, v), 1e-9)
    return 265 * np.maximum(0.0, 1 - slope / np.maximum(np.tan(skyline(from_north)), 1e-9))


def behind_mountain(muons: Muons) -> Muons:
    """Return those of sea-level muons whose energy suffices for the rock, with what it leaves them.

    dE/dx = -(a + b E) (Particle Data Group, Phys. Rev. D 110 (2024) 030001, section 34.6), without fluctuations.
    """
    thickness = rock(*(column.astype(np.float64) for column in (muons.u, muons.v, muons.w)))
    ratio = IONISATION / RADIATION
    energy = (muons.kinetic_energy + ratio) * np.exp(-RADIATION * thickness) - ratio
    left = replace(muons, kinetic_energy=energy.astype(np.float32))
    return left[energy >= LOWEST_ENERGY]
