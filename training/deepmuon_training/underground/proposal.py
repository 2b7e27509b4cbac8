"""From which energies and zenith angles muons at a depth are tried: close to what is there, but drawn in no time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY
from deepmuon_training.underground.place import Place

__all__ = ["Proposal", "Trials", "proposal", "sharpened"]

ENERGIES, COSINES = 200, 64
"""Cells in ln E, from 1 MeV to 100 TeV, and in cos zenith."""

BLURRED, FLAT = 0.15, 0.05
"""Shares of the proposal that are not the flux by mean losses, but that blurred by `BLUR` cells, and the spectrum of
that, blurred further, at all zenith angles alike: losses fluctuate, and muons scatter."""

BLUR, FAR_BLUR = 3.0, 6.0

STEPS = (25, 15)
"""Quantiles of energy and of cos zenith between which a proposal is sharpened."""

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Trials:
    """Muons that are tried, n of them.

    Parameters
    ----------
    energy, cos_zenith
        Kinetic energy [GeV], cos zenith.
    density
        Of the proposal there [1/(GeV sr)].
    """

    energy: Float
    cos_zenith: Float
    density: Float


@dataclass(frozen=True)
class Proposal:
    """A density that is constant in each cell of ln E and cos zenith.

    Parameters
    ----------
    log_energy, cosine
        Edges of the cells.
    content
        Probability of each cell [energy, cosine].
    """

    log_energy: Float
    cosine: Float
    content: Float

    def draw(self, n: int, random: np.random.Generator, *, evenly: bool) -> Trials:
        """Draw n trials.

        Parameters
        ----------
        n
            How many.
        random
            For random numbers.
        evenly
            Whether each cell gets its share as exactly as whole numbers can, and not as chance has it: sums over such
            trials fluctuate less, but they are not independent.
        """
        places = (np.arange(n) + random.random()) / n if evenly else random.random(n)
        cumulative = np.cumsum(self.content.ravel())
        cell = np.searchsorted(cumulative, places * cumulative[-1], side="right")
        row, column = np.divmod(np.minimum(cell, self.content.size - 1), self.content.shape[1])
        height, width = np.diff(self.log_energy), np.diff(self.cosine)
        energy = np.exp(self.log_energy[row] + height[row] * random.random(n))
        cosine = self.cosine[column] + width[column] * (1 - random.random(n))  # never 0
        area = 2 * np.pi * energy * height[row] * width[column]
        return Trials(energy, cosine, self.content[row, column] / (cumulative[-1] * area))


def proposal(at: Place, lowest_cosine: float = 0.0, columns: int = COSINES) -> Proposal:
    """Return a proposal for the muons that cross a horizontal plane at a depth.

    Parameters
    ----------
    at
        The depth.
    lowest_cosine, columns
        cos zenith from which on they are wanted, and cells from there to 1.
    """
    log_energy = np.linspace(np.log(LOWEST_ENERGY), np.log(HIGHEST_ENERGY), ENERGIES + 1)
    cosine = np.linspace(lowest_cosine, 1, columns + 1)
    middle, across = np.exp((log_energy[1:] + log_energy[:-1]) / 2)[:, None], (cosine[1:] + cosine[:-1]) / 2
    plane = at.mean_loss_intensity(middle, across) * middle * across
    near = plane / plane.sum()
    blurred = gaussian_filter(near, BLUR if columns > 1 else (BLUR, 0), mode="constant")
    spectrum = gaussian_filter(near.sum(axis=1), FAR_BLUR, mode="nearest")[:, None] * np.ones(columns)
    content = (1 - BLURRED - FLAT) * near + sum(
        share * part / part.sum() for share, part in ((BLURRED, blurred), (FLAT, spectrum))
    )
    return Proposal(log_energy, cosine, content)


def sharpened(by: Proposal, trials: Trials, weight: Float) -> Proposal:
    """Return a proposal that gives more trials where weights are large, given those of some trials of it.

    The best proposal for a sum goes with the root of the mean square of the weights: that factor is found for the
    energy, and then for the angle.
    """
    energy, cosine = np.log(trials.energy), trials.cos_zenith
    rows = _factor(energy, weight, STEPS[0])
    left = weight / rows(energy)
    columns = _factor(cosine, left, STEPS[1])
    middles = [(edges[1:] + edges[:-1]) / 2 for edges in (by.log_energy, by.cosine)]
    content = by.content * rows(middles[0])[:, None] * columns(middles[1])
    return Proposal(by.log_energy, by.cosine, content / content.sum())


def _factor(places: Float, weight: Float, steps: int) -> _Interpolated:
    edges = np.quantile(places, np.linspace(0, 1, steps + 1))
    step = np.clip(np.searchsorted(edges, places) - 1, 0, steps - 1)
    squares = np.bincount(step, weight**2, steps) / np.maximum(np.bincount(step, minlength=steps), 1)
    return _Interpolated((edges[1:] + edges[:-1]) / 2, np.sqrt(squares / squares.mean()) + 1e-3)


@dataclass(frozen=True)
class _Interpolated:
    """Linear between places."""

    places: Float
    values: Float

    def __call__(self, at: Float) -> Float:
        return np.interp(at, self.places, self.values)
