"""Muons that cross a horizontal plane, drawn from any flux by tables of its cumulative distributions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_training.fluxes.flux import Flux

__all__ = ["PlaneSampler"]

_PER_DECADE = 200  # energies in the table
_COSINES = 500
_QUANTILES = 400

_LOWEST_COSINE = 1e-8
_LOWEST_PROBABILITY = 2.0**-54  # below any of NumPy's random numbers

Float = NDArray[np.float64]


class PlaneSampler:
    """Draws independent muons of a flux that cross a horizontal plane downwards, J(E, zenith) cos(zenith).

    Between the 200 energies of a decade and the 500 angles of its tables the flux goes as a power of E and of cos
    zenith, and its cumulative distributions are inverted exactly; quantiles of the angle are interpolated between
    energies. A smooth flux comes out within a few parts in 100,000.

    Parameters
    ----------
    flux
        Where from.
    minimum, maximum
        Range of the kinetic energy [GeV], within the flux's own.
    """

    def __init__(self, flux: Flux, minimum: float, maximum: float) -> None:
        """Tabulate the flux."""
        self._flux = flux
        cells = int(np.ceil(np.log10(maximum / minimum) * _PER_DECADE))
        self._log_energy = np.linspace(np.log(minimum), np.log(maximum), cells + 1)
        self._range = (minimum, maximum)
        # Finer where cos zenith is near 1, and down to the horizon.
        log_cosine = -(np.linspace(np.sqrt(-np.log(_LOWEST_COSINE)), 0, _COSINES) ** 2)
        self._log_probability = -(np.linspace(np.sqrt(-np.log(_LOWEST_PROBABILITY)), 0, _QUANTILES) ** 2)
        cosine = np.exp(log_cosine)
        plane = np.empty(len(self._log_energy))
        self._log_cosine = np.empty((len(self._log_energy), _QUANTILES))
        for i, energy in enumerate(np.exp(self._log_energy)):
            plus, minus = flux.intensity(energy, cosine)
            # One cosine is the plane's, the other is of d cos zenith = cos zenith d ln(cos zenith).
            cumulative = _cumulative((plus + minus) * cosine**2, log_cosine)
            plane[i] = cumulative[-1] * energy
            self._log_cosine[i] = np.interp(self._log_probability, np.log(cumulative / cumulative[-1]), log_cosine)
        self._plane = plane
        steps = np.diff(self._log_energy) * _mean(plane[:-1], plane[1:])
        self._below = np.concatenate([[0.0], np.cumsum(steps)])
        self._below /= self._below[-1]

    def draw(self, n: int, seed: int | Sequence[int]) -> Muons:
        """Draw n muons, with a seed of NumPy's default generator."""
        random = np.random.default_rng(seed)
        energy = self._energies(random.random(n))
        cos_zenith = self._cosines(energy, 1 - random.random(n))
        azimuth = 2 * np.pi * random.random(n)
        plus, minus = self._flux.intensity(energy, cos_zenith)
        positive = random.random(n) * (plus + minus) < plus
        sine = np.sqrt((1 - cos_zenith) * (1 + cos_zenith))
        u, v = sine * np.cos(azimuth), sine * np.sin(azimuth)
        return Muons.of(energy, u, v, -cos_zenith, np.where(positive, MU_PLUS, MU_MINUS))

    def _energies(self, probability: Float) -> Float:
        """Invert the cumulative distribution of the energy, a power law in each cell."""
        cell = np.searchsorted(self._below, probability, side="right") - 1
        share = (probability - self._below[cell]) / (self._below[cell + 1] - self._below[cell])
        slope = np.log(self._plane[cell + 1] / self._plane[cell])
        flat = np.abs(slope) < 1e-12
        place = np.where(flat, share, np.log1p(share * np.expm1(slope)) / np.where(flat, 1.0, slope))
        step = self._log_energy[1] - self._log_energy[0]
        energy: Float = np.clip(np.exp(self._log_energy[cell] + place * step), *self._range)
        return energy

    def _cosines(self, energy: Float, probability: Float) -> Float:
        """Invert the cumulative distribution of cos zenith, given the energy."""
        place = (np.log(energy) - self._log_energy[0]) / (self._log_energy[1] - self._log_energy[0])
        row = np.clip(place.astype(int), 0, len(self._log_energy) - 2)
        log_probability = np.log(probability)
        root = np.sqrt(-self._log_probability[0])
        column = ((1 - np.sqrt(-log_probability) / root) * (_QUANTILES - 1)).astype(int)
        column = np.clip(column, 0, _QUANTILES - 2)
        left, right = self._log_probability[column], self._log_probability[column + 1]
        across = (log_probability - left) / (right - left)
        table = self._log_cosine
        lower = table[row, column] * (1 - across) + table[row, column + 1] * across
        upper = table[row + 1, column] * (1 - across) + table[row + 1, column + 1] * across
        cos_zenith: Float = np.minimum(np.exp(lower + (place - row) * (upper - lower)), 1.0)
        return cos_zenith


def _mean(one: Float, other: Float) -> Float:
    """Mean of a power law between two positive values, over the logarithm of its argument."""
    slope = np.log(other / one)
    flat = np.abs(slope) < 1e-9
    return np.where(flat, one, (other - one) / np.where(flat, 1.0, slope))


def _cumulative(density: Float, log_argument: Float) -> Float:
    """Integral from an argument of 0 to each of these, of a density per unit of its logarithm."""
    cells = _mean(density[:-1], density[1:]) * np.diff(log_argument)
    exponent = np.log(density[1] / density[0]) / (log_argument[1] - log_argument[0])
    return np.cumsum(np.concatenate([[density[0] / exponent], cells]))
