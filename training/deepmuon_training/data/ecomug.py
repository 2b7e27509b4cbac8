"""A parametric sea-level muon flux: muons without any file, and a smooth truth to test against.

D. Pagano, G. Bonomi et al., "EcoMug: An Efficient COsmic MUon Generator for cosmic-ray muon
applications", NIM A 1014 (2021) 165732.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deepmuon_runtime.muon_file.writer import MuonWriter
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY
from deepmuon_training.sample import Sample

__all__ = [
    "CHARGE_RATIO",
    "MUON_MASS",
    "intensity",
    "plane_rate",
    "sea_level_muons",
    "write_sea_level",
    "zenith_exponent",
]

MUON_MASS = 0.1056583755
"""Mass of the muon [GeV], Particle Data Group 2024."""

CHARGE_RATIO = 1.28
"""mu+ for each mu- at sea level, about what CMS measures near 10 GeV (Phys. Lett. B 692 (2010) 83)."""

PIECE = 1 << 18  # muons that are drawn at once

_GRID_SIZE = 200_001


def zenith_exponent(momentum: ArrayLike) -> NDArray[np.float64]:
    """Exponent n of the intensity's (cos zenith)^n at a momentum [GeV/c]."""
    return np.maximum(0.1, 2.856 - 0.655 * np.log(np.asarray(momentum, dtype=np.float64)))


def intensity(momentum: ArrayLike, cos_zenith: ArrayLike) -> NDArray[np.float64]:
    """Differential intensity J [1/(m2 s sr GeV/c)] at momentum p [GeV/c] and zenith angle.

    J = 1600 (p + 2.68)^-3.175 p^0.279 cos(zenith)^n(p), the parametrisation of EcoMug. The flux through a
    horizontal plane is J cos(zenith).
    """
    p = np.asarray(momentum, dtype=np.float64)
    return 1600.0 * (p + 2.68) ** -3.175 * p**0.279 * np.asarray(cos_zenith) ** zenith_exponent(p)


def _momentum(kinetic_energy: ArrayLike) -> NDArray[np.float64]:
    energy = np.asarray(kinetic_energy, dtype=np.float64)
    return np.sqrt(energy * (energy + 2 * MUON_MASS))


@lru_cache(maxsize=1)
def _cumulative_rate(minimum: float, maximum: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Log kinetic energy on a fine grid, and the plane rate [Hz/m2] from `minimum` [GeV] up to it.

    Over the hemisphere, the integral of J cos(zenith) is 2 pi J(p, vertical) / (n(p) + 2); dp = (E + m) / p dE.
    """
    log_energy = np.linspace(np.log(minimum), np.log(maximum), _GRID_SIZE)
    energy = np.exp(log_energy)
    p = _momentum(energy)
    density = intensity(p, 1.0) * 2 * np.pi / (zenith_exponent(p) + 2) * (energy + MUON_MASS) / p * energy
    steps = 0.5 * (density[1:] + density[:-1]) * np.diff(log_energy)
    return log_energy, np.concatenate([[0.0], np.cumsum(steps)])


def plane_rate(minimum: float = LOWEST_ENERGY, maximum: float = HIGHEST_ENERGY) -> float:
    """Rate through a horizontal plane [Hz/m2] between two kinetic energies [GeV]."""
    return float(_cumulative_rate(minimum, maximum)[1][-1])


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
    random = np.random.default_rng(seed)
    log_energy, cumulative = _cumulative_rate(minimum, maximum)
    energy = np.exp(np.interp(random.random(n) * cumulative[-1], cumulative, log_energy))
    cos_zenith = (1 - random.random(n)) ** (1 / (zenith_exponent(_momentum(energy)) + 2))
    azimuth = 2 * np.pi * random.random(n)
    positive = random.random(n) < charge_ratio / (1 + charge_ratio)
    sine = np.sqrt((1 - cos_zenith) * (1 + cos_zenith))
    u, v = sine * np.cos(azimuth), sine * np.sin(azimuth)
    return Muons.of(energy, u, v, -cos_zenith, np.where(positive, MU_PLUS, MU_MINUS))


def write_sea_level(
    path: str | Path,
    n: int,
    *,
    seed: int,
    charge_ratio: float = CHARGE_RATIO,
    overwrite: bool = False,
) -> Sample:
    """Write n independent muons crossing a horizontal plane at sea level, 1 MeV to 100 TeV, to a muon file.

    Fewer muons of a seed are the first of more; any number needs the same memory.

    Parameters
    ----------
    path, overwrite
        As for `deepmuon_runtime.MuonWriter`.
    n, charge_ratio
        As for `sea_level_muons`.
    seed
        0 or more. Piece k of 262,144 muons has the seed (seed, k) of NumPy's default generator.

    Returns
    -------
    What the file says, as a sample without its muons.

    Raises
    ------
    RefusedError, FailedError
        As for `deepmuon_runtime.MuonWriter`.
    """
    sample = Sample(
        Muons.empty(0),
        depth_m=0.0,
        source="parametric flux of EcoMug (NIM A 1014 (2021) 165732), 1 MeV to 100 TeV",
        provenance=(f"{n} muons drawn, {charge_ratio:g} mu+ for each mu-, seed {seed}",),
        rate=plane_rate(),
        flux="ecomug",
    )
    with MuonWriter(path, sample.attributes, overwrite) as writer:
        for k in range(-(-n // PIECE)):
            piece = sea_level_muons(PIECE, seed=(seed, k), charge_ratio=charge_ratio)
            writer.append(piece[: n - k * PIECE])
    return sample
