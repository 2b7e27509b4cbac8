"""Whether a flux has bumps or kinks: derivatives of its logarithm over energy and angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deepmuon_training.fluxes.energy_loss import ionisation_loss
from deepmuon_training.fluxes.flux import FLUX_END, Intensity

__all__ = ["smoothness"]

Float = NDArray[np.float64]

COSINES = np.array([0.0, 0.001, 0.01, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 0.9, 1.0])


def smoothness(flux: Intensity) -> list[tuple[str, str, str, bool]]:
    """Return what is asked, and found: the words of a score.

    A kink is a jump of the first derivative, and makes the second one as large as the grid is fine; a bump is a slope
    that rises.
    """
    log_energy = np.linspace(np.log(1e-3), np.log(FLUX_END), 8001)
    plus, minus = flux(np.exp(log_energy), COSINES[:, None])
    log_flux = np.log(plus + minus)
    slope = np.gradient(log_flux, log_energy, axis=1)[:, 2:-2]
    bend = np.gradient(slope, log_energy[2:-2], axis=1)[:, 2:-2]
    turn = np.gradient(bend, log_energy[4:-4], axis=1)[:, 2:-2]
    steep = np.maximum(bend[COSINES >= 0.3], 0)
    place = np.linspace(0, np.arcsinh(1 / 0.05), 2001)  # of cos zenith: linear at the horizon, logarithmic above
    plus, minus = flux(np.geomspace(1e-3, FLUX_END, 46)[:, None], 0.05 * np.sinh(place))
    across = np.gradient(np.gradient(np.log(plus + minus), place, axis=1), place, axis=1)[:, 4:-4]
    edge = np.gradient(across, place[4:-4], axis=1)[:, 2:-2]
    slow = np.geomspace(1e-3, 0.3, 100)
    stopping = np.add(*flux(slow, COSINES[COSINES >= 0.1, None])) * ionisation_loss(slow)
    law = stopping / stopping[:, :1] - 1
    shape = stopping / stopping[-1]
    one_shape = shape / shape[:, :1] - 1
    positive = bool(np.isfinite(log_flux).all())
    return [
        ("above 0 everywhere, from 1 MeV to 1 PeV and to the horizon", "yes", "yes" if positive else "no", positive),
        _within("second derivative of ln J in ln E", bend, 1),
        _within("third derivative of ln J in ln E", turn, 1),
        _within("rise of the slope of ln J in ln E, cos zenith from 0.3", steep, 0.1),
        _within("second derivative of ln J in asinh(cos zenith / 0.05)", across, 5),
        _within("third derivative of ln J in asinh(cos zenith / 0.05)", edge, 5),
        _within("J S(E) by that at 1 MeV, to 0.1 GeV, less 1", law[..., slow <= 0.1], 0.01),
        _within("J S(E) by that at 1 MeV, to 0.3 GeV, less 1", law, 0.05),
        _within("zenith angles by those at 1 MeV, to 0.3 GeV, cos zenith from 0.1, less 1", one_shape, 0.05),
    ]


def _within(what: str, values: Float, limit: float) -> tuple[str, str, str, bool]:
    low, high = float(values.min()), float(values.max())
    return what, f"within {limit:g}", f"{low:.3f} to {high:.3f}", max(-low, high) <= limit
