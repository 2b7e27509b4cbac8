"""Two samplers of the parametric sea-level flux, as a physicist would write them in NumPy in an afternoon.

Muons through a horizontal plane, 10 MeV/c to 1 TeV/c: J(p, cos zenith) cos zenith, where J = 1600 (p + 2.68)^-3.175
p^0.279 cos(zenith)^n(p), n = max(0.1, 2.856 - 0.655 ln p), p in GeV/c (EcoMug, NIM A 1014 (2021) 165732).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["PIECE", "accept_reject", "inverse_cdf"]

PIECE = 1 << 16
"""The most muons made at once."""

MASS = 0.1056583755  # GeV
LOG_P = np.linspace(np.log(0.01), np.log(1000.0), 4096)

Float = NDArray[np.float64]


def exponent(p: Float) -> Float:
    """Exponent of cos zenith at a momentum."""
    return np.maximum(0.1, 2.856 - 0.655 * np.log(p))


def vertical(p: Float) -> Float:
    """Vertical intensity for each unit of ln p."""
    return 1600.0 * (p + 2.68) ** -3.175 * p**1.279


_P = np.exp(LOG_P)
_HIGHEST = vertical(_P).max()
_RATE = vertical(_P) * 2 * np.pi / (exponent(_P) + 2)  # over all directions
_CUMULATIVE = np.concatenate([[0.0], np.cumsum((_RATE[1:] + _RATE[:-1]) / 2)])


def accept_reject(random: np.random.Generator, n: int) -> list[NDArray[np.float32]]:
    """Return kinetic energy [GeV], u, v, w and charge of n muons: ln p and cos zenith by acceptance."""
    momenta, cosines, count = [], [], 0
    while count < n:
        p = np.exp(random.uniform(LOG_P[0], LOG_P[-1], n))
        cosine = random.random(n)
        accepted = random.random(n) * _HIGHEST < vertical(p) * cosine ** (exponent(p) + 1)
        momenta.append(p[accepted])
        cosines.append(cosine[accepted])
        count += len(momenta[-1])
    return _columns(random, np.concatenate(momenta)[:n], np.concatenate(cosines)[:n])


def inverse_cdf(random: np.random.Generator, n: int) -> list[NDArray[np.float32]]:
    """Return the same: ln p by a table of its cumulative distribution, cos zenith by its power law."""
    p = np.exp(np.interp(random.random(n) * _CUMULATIVE[-1], _CUMULATIVE, LOG_P))
    return _columns(random, p, (1 - random.random(n)) ** (1 / (exponent(p) + 2)))


def _columns(random: np.random.Generator, p: Float, cosine: Float) -> list[NDArray[np.float32]]:
    energy = p * p / (np.sqrt(p * p + MASS * MASS) + MASS)
    azimuth = random.uniform(0, 2 * np.pi, len(p))
    sine = np.sqrt(1 - cosine * cosine)
    charge = np.where(random.random(len(p)) < 0.561, 1.0, -1.0)
    columns = (energy, sine * np.cos(azimuth), sine * np.sin(azimuth), -cosine, charge)
    return [column.astype(np.float32) for column in columns]
