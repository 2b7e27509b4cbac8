"""The rate of muons through a horizontal plane, by quadrature."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import FailedError
from deepmuon_training.fluxes.flux import Flux

__all__ = ["PRECISION", "plane_rate"]

PRECISION = 1e-6
"""By how much of itself a rate may change where the grid is made twice as fine."""

_POINTS = 6  # of Gauss and Legendre, in each panel
_FEWEST = (64, 4)  # panels in log energy and in angle
_DOUBLINGS = 5

Float = NDArray[np.float64]


@lru_cache(maxsize=64)
def plane_rate(flux: Flux, minimum: float, maximum: float) -> float:
    """Rate [1/(m2 s)] of muons of both charges that cross a horizontal plane downwards.

    The integral of J cos(zenith) over the hemisphere and between two kinetic energies [GeV], by Gauss and Legendre's
    rule in panels of ln E and of the cube root of cos zenith, which makes powers of cos zenith smooth at the horizon.

    Raises
    ------
    FailedError
        If the panels, halved five times, never agree within `PRECISION`: the flux is too rough to be integrated.
    """
    rates = [_rate(flux, minimum, maximum, *_FEWEST)]
    for k in range(1, _DOUBLINGS + 1):
        rates.append(_rate(flux, minimum, maximum, *(panels << k for panels in _FEWEST)))
        if abs(rates[-1] - rates[-2]) <= PRECISION * rates[-1]:
            return rates[-1]
    raise FailedError(
        f"the rate of the flux {flux.name} can't be told: {rates[-2]:.6g} and {rates[-1]:.6g} per m2 and s on two grids"
    )


def _rate(flux: Flux, minimum: float, maximum: float, energies: int, angles: int) -> float:
    log_energy, energy_weight = _panels(np.log(minimum), np.log(maximum), energies)
    root, root_weight = _panels(0.0, 1.0, angles)
    energy, cos_zenith = np.exp(log_energy)[:, None], root**3
    plus, minus = flux.intensity(energy, cos_zenith)
    solid_angle = 2 * np.pi * cos_zenith * 3 * root**2 * root_weight  # times cos zenith, of the plane
    return float((energy_weight * energy[:, 0]) @ (plus + minus) @ solid_angle)


def _panels(low: float, high: float, number: int) -> tuple[Float, Float]:
    """Nodes and weights of the rule in each of so many panels."""
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    edges = np.linspace(low, high, number + 1)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (1 + nodes)).ravel(), (half * weights).ravel()
