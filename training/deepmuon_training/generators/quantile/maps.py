"""The `quantile` generator: a triangular transport map, one muon a draw.

Energy from one latent, zenith from another given the energy, charge from a third given both, azimuth from a fourth,
uniform or given both: a Knothe-Rosenblatt map (G. Carlier, A. Galichon, F. Santambrogio, SIAM J. Math. Anal. 41 (2010)
2554), each step monotone in its latent and so the solution of a one-dimensional transport problem.

What is learned are densities, see `deepmuon_training.learning.splines`; the maps are the quantile functions of these.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.generators.quantile.azimuth_fit import AzimuthDensity
from deepmuon_training.learning.splines import Surface

__all__ = ["LEAST_COS_ZENITH", "QuantileGenerator", "inclination", "inclination_slope"]

LEAST_COS_ZENITH = 2.0**-20
"""No muon is horizontal, or goes up."""

_ROUNDING = 2.0**-21  # relative, of cos zenith in the graph
_STEEPEST_COSINE = 1 - 1e-12  # 1.4 microradian from the vertical
_VERTICAL = 30.0  # logit of a cos zenith beyond which there are hardly any muons

_HORIZON_SHARE = 0.2  # of the logarithm in `inclination`: cos zenith rules above it, the logarithm below

_GRID = expit(np.linspace(-18, 18, 8001))
"""Where densities are integrated, between 0 and 1: dense at both ends, beside which a quantile function is steep."""

_FAR = 60.0  # logit of the level of a distribution's end

Float = NDArray[np.float64]


def inclination(cos_zenith_logit: Float) -> Float:
    """Return x = 1 - cos zenith - ln(cos zenith) / 5: 0 at the vertical, and endless at the horizon.

    Over x the density of muons is smooth at the vertical, and where it is a straight line near the horizon it is
    a power of cos zenith.
    """
    x: Float = expit(-cos_zenith_logit) + _HORIZON_SHARE * np.logaddexp(0, -cos_zenith_logit)
    return x


def inclination_slope(cos_zenith_logit: Float) -> Float:
    """Return how much x falls with the logit of cos zenith."""
    versine = expit(-cos_zenith_logit)
    slope: Float = versine * (1 + _HORIZON_SHARE - versine)
    return slope


@dataclass(frozen=True)
class QuantileGenerator:
    """Energy, zenith and charge maps, by their densities.

    Parameters
    ----------
    transform
        Of the energy in the azimuth's network; its mean is kept for the record.
    energy
        Logarithm of the density of muons over ln E/GeV.
    zenith
        That of their density over the logit t of the energy's level, and x as in `inclination`; what is made of it is
        the distribution of x at any t.
    charge
        Logit P(mu+) over the same; or the one charge that all muons have.
    energy_range
        Least and largest kinetic energy [GeV].
    cos_zenith_min
        No muon is flatter.
    azimuth
        Its density, or None where it is uniform.
    """

    transform: EnergyTransform
    energy: Surface
    zenith: Surface
    charge: Surface | int
    energy_range: tuple[float, float]
    cos_zenith_min: float = 0.0
    azimuth: AzimuthDensity | None = None

    def log_energy(self, t: Float) -> Float:
        """Return ln E/GeV [n] at logits t [n] of the energy's level."""
        return np.interp(t, *self._energy_levels)

    def energy_logit(self, log_energy: Float) -> Float:
        """Return t [n] of ln E/GeV [n]."""
        t, known = self._energy_levels
        return np.interp(log_energy, known, t)

    def cos_zenith_logit(self, level: Float, t: Float) -> Float:
        """Return logit cos zenith [n, m] at logits [m] or [n, m] of its level, given t [n]."""
        lowest = _least_logit(max(self.cos_zenith_min, LEAST_COS_ZENITH))
        x = lowest + (max(_VERTICAL, lowest + 1) - lowest) * _GRID
        density = self.zenith(self._within(t), inclination(x)) + np.log(inclination_slope(x))
        rows = np.broadcast_to(level, (len(t), np.shape(level)[-1]))
        return np.array([np.interp(row, *_levels(x, one)) for row, one in zip(rows, density, strict=True)])

    def charge_logit(self, t: Float, cos_zenith_logit: Float) -> Float:
        """Return logit P(mu+) [n] given t [n] and logit cos zenith [n]."""
        if not isinstance(self.charge, Surface):
            return np.full(len(t), math.inf * self.charge)
        return self.charge.at(self._within(t), inclination(cos_zenith_logit))

    def y(self, t: Float) -> Float:
        """Return the coordinate y [n] of the azimuth's network at logits t [n] of the energy's level."""
        return self.transform.pre_tanh(np.exp(self.log_energy(t)))

    @cached_property
    def _energy_levels(self) -> tuple[Float, Float]:
        low, high = np.log(self.energy_range)
        x = low + (high - low) * _GRID
        return _levels(x, self.energy(x, np.zeros(1))[:, 0])

    def _within(self, t: Float) -> Float:
        """Beyond the outermost of a sample's muons all share one distribution of angles and charges."""
        return np.clip(t, self.zenith.x.low, self.zenith.x.high)


def _levels(x: Float, log_density: Float) -> tuple[Float, Float]:
    """Return logits of levels, and x at these, of a density [n] on a grid [n]; each end has a level of its own."""
    density = np.exp(log_density - log_density.max())
    parts = np.maximum(np.diff(x) * (density[1:] + density[:-1]), 1e-300)
    below, above = np.cumsum(parts)[:-1], np.cumsum(parts[::-1])[-2::-1]
    return np.concatenate([[-_FAR], np.log(below / above), [_FAR]]), x


def _least_logit(cos_zenith_min: float) -> float:
    """Return the logit of cos zenith under which float32 would be below the least."""
    least = min(cos_zenith_min * (1 + _ROUNDING), _STEEPEST_COSINE)
    return math.log(least / (1 - least))
