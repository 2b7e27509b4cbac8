"""Power laws for the ends of the energy spectrum, where a training sample thins out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

__all__ = ["TAIL_MUONS", "PowerLawTails", "fit_power_law", "outermost"]

TAIL_MUONS = 1000
"""Each tail is fitted to, and begins at, so many muons from the end of the training sample, if it is a large one."""

LARGEST_TAIL = 1 / 60
"""No tail takes a larger share of the sample: above 50 GeV the sea-level spectrum is near a power law, at 7 GeV not."""

_FARTHEST = 500.0  # times the logarithm of the range: exponents beyond say that all lies at one end

Float = NDArray[np.float64]


def outermost(number: int) -> int:
    """Return how many muons of a sample of `number` make a tail."""
    return min(TAIL_MUONS, int(LARGEST_TAIL * number))


def fit_power_law(values: Float, low: float, high: float) -> float:
    """Exponent g of a survival function proportional to x^-g - high^-g on [low, high].

    The maximum of the likelihood of a truncated Pareto distribution (I. B. Aban et al., J. Am. Stat. Assoc. 101
    (2006) 270), which also allows g <= 0.

    Parameters
    ----------
    values
        Observed x, all within [low, high].
    low, high
        Ends of the range, positive.
    """
    mean_log = float(np.mean(np.log(values / low)))
    span = np.log(high / low)

    def excess(exponent: float) -> float:
        """Return the expected mean of log(x / low), less the observed one."""
        if abs(exponent * span) < 1e-6:
            return float(span / 2 - mean_log)
        return float(1 / exponent - span / np.expm1(exponent * span) - mean_log)

    if span == 0:
        return 1.0  # whatever it is
    farthest = float(_FARTHEST / span)
    ends = excess(-farthest), excess(farthest)
    if ends[0] * ends[1] >= 0:  # all at one end
        return farthest if ends[1] > 0 else -farthest
    return float(brentq(excess, -farthest, farthest))


@dataclass(frozen=True)
class PowerLawTails:
    """The energy [GeV] of the muons nearest to both ends of the spectrum.

    Parameters
    ----------
    level
        Probability of each tail.
    low, high
        Energies where the tails begin.
    low_exponent, high_exponent
        F(E) goes as E^low_exponent - energy_min^low_exponent below `low`; the survival function as
        E^-high_exponent - energy_max^-high_exponent above `high`.
    energy_min, energy_max
        The spectrum's ends.
    """

    level: float
    low: float
    high: float
    low_exponent: float
    high_exponent: float
    energy_min: float
    energy_max: float

    @classmethod
    def fit(cls, kinetic_energy: Float, *, energy_min: float, energy_max: float) -> PowerLawTails:
        """Fit both tails to the lowest and highest energies [GeV] of a sample."""
        n = len(kinetic_energy)
        count = outermost(n)
        ordered = np.partition(kinetic_energy, [count, n - count - 1])
        low, high = float(ordered[count]), float(ordered[n - count - 1])
        low_exponent = fit_power_law(1 / ordered[:count], 1 / low, 1 / energy_min)
        high_exponent = fit_power_law(ordered[-count:], high, energy_max)
        return cls(count / n, low, high, low_exponent, high_exponent, energy_min, energy_max)

    def lowest(self, level: Float) -> Float:
        """Quantile of the energy at a cumulative probability below `level`."""
        return 1 / _quantile(level / self.level, 1 / self.low, 1 / self.energy_min, self.low_exponent)

    def highest(self, level: Float) -> Float:
        """Quantile of the energy at a survival probability below `level`."""
        return _quantile(level / self.level, self.high, self.energy_max, self.high_exponent)


def _quantile(survival: Float, low: float, high: float, exponent: float) -> Float:
    """Where the survival function of a power law on [low, high] takes a value."""
    ratio = (high / low) ** -exponent
    within = np.minimum(survival, 1.0)  # beyond which the power law does not hold
    quantile: Float = low * (ratio + within * (1 - ratio)) ** (-1 / exponent)
    return quantile
