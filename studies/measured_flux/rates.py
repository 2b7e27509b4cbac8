"""Rates of the flux `measured` through a horizontal plane, and what they may be wrong by."""

from __future__ import annotations

from dataclasses import astuple
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deepmuon_training.fluxes.ecomug import ecomug
from deepmuon_training.fluxes.flux import FLUX_END, MUON_MASS, Flux, Intensity
from deepmuon_training.fluxes.gccly import gccly
from deepmuon_training.fluxes.measured import Parameters, intensity
from deepmuon_training.fluxes.plane import plane_rate
from studies.measured_flux.data import read_bess

__all__ = ["Rate", "rate_rows", "rates"]

UNMEASURED = 0.3
"""Error of the flux below BESS-TeV's first bin: formulas and calculated cascades are as far apart there."""

Float = NDArray[np.float64]


class Rate(NamedTuple):
    """Muons per m2 and s through a horizontal plane, and the parts of its error, alike."""

    above_gev: float
    rate: float
    error: float
    of_fit: float
    """From the covariance of the parameters."""
    of_scale: float
    """From the systematic errors of BESS-TeV, as if they were one."""
    of_slow_muons: float
    """From energies below BESS-TeV's."""
    of_zenith: float
    """From the zenith angles, which neither experiment's table has: the largest change by another flux's."""
    other_shape: float
    """The rate with the zenith angles of that flux."""


def rates(parameters: Parameters, covariance: Float, other: Intensity | None = None) -> list[Rate]:
    """Return the rates above 1 MeV and 1 GeV; `other` is a further flux to take zenith angles from."""
    return [_rate(parameters, covariance, above, other) for above in (1e-3, 1.0)]


def rate_rows(measured: list[Rate]) -> list[tuple[str, ...]]:
    """Return a table of them, and of those of the other formulas: its head, and a row for each."""
    head = ("flux, above", "per m² and s", "per cm² and min", "error", "fit", "scale", "slow muons", "zenith angles")
    rows = [head]
    for one in measured:
        parts = (one.error, one.of_fit, one.of_scale, one.of_slow_muons, one.of_zenith)
        rows.append((f"`measured`, {_energy(one)}", *_twice(one.rate), *(f"{part:.1f}" for part in parts)))
    for flux in (gccly(), ecomug()):
        for one in measured:
            rate = plane_rate(flux, one.above_gev, flux.energy_max)
            rows.append((f"`{flux.name}`, {_energy(one)}", *_twice(rate), *[""] * 5))
    return rows


def _energy(rate: Rate) -> str:
    return "1 MeV" if rate.above_gev < 1 else "1 GeV"


def _twice(rate: float) -> tuple[str, str]:
    """Return a rate in both units."""
    return f"{rate:.1f}", f"{60e-4 * rate:.3f}"


def _rate(parameters: Parameters, covariance: Float, above: float, other: Intensity | None) -> Rate:
    bess = read_bess()
    first = float(np.hypot(bess.low[0], MUON_MASS) - MUON_MASS)
    rate = _of(parameters, above)
    gradient = np.array([_derivative(parameters, i, above) for i in range(len(covariance))])
    of_fit = float(np.sqrt(gradient @ covariance @ gradient))
    of_scale = rate * float(bess.systematic.sum() / bess.flux.sum())
    of_slow = UNMEASURED * (rate - _of(parameters, first)) if above < first else 0.0
    shapes = [gccly().intensity, ecomug().intensity] if other is None else [other]
    swapped = [_with_shape_of(shape, parameters, above) for shape in shapes]
    far = max(swapped, key=lambda changed: abs(changed - rate))
    error = float(np.linalg.norm([of_fit, of_scale, of_slow, far - rate]))
    return Rate(above, rate, error, of_fit, of_scale, of_slow, abs(far - rate), far)


def _of(parameters: Parameters, above: float) -> float:
    def flux(energy: Float, cos_zenith: Float) -> tuple[Float, Float]:
        return intensity(energy, cos_zenith, parameters)

    return plane_rate(Flux("measured", "", flux), above, FLUX_END)


def _derivative(parameters: Parameters, i: int, above: float) -> float:
    values = np.array(astuple(parameters))
    step = np.zeros(len(values))
    step[i] = 1e-3 * values[i]
    upper, lower = (_of(Parameters(*(values + sign * step)), above) for sign in (1, -1))
    return (upper - lower) / float(2 * step[i])


def _with_shape_of(other: Intensity, parameters: Parameters, above: float) -> float:
    """Return the rate of the vertical flux with another flux's zenith angles."""

    def flux(energy: Float, cos_zenith: Float) -> tuple[Float, Float]:
        vertical = np.ones(1)
        shape = sum(other(energy, cos_zenith)) / sum(other(energy, vertical))
        plus, minus = intensity(energy, vertical, parameters)
        return plus * shape, minus * shape

    return plane_rate(Flux("changed", "", flux), above, 1e4)
