"""What was measured: vertical muons by BESS-TeV and L3+C, as their papers print them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deepmuon_training.fluxes.flux import MUON_MASS, Intensity

__all__ = ["L3", "Bess", "read_bess", "read_l3"]

FOLDER = Path(__file__).parent

BESS_COSINE = 0.95
"""Mean cos zenith of BESS-TeV's muons, all of which have more than 0.9; a mean over those is within 0.5 % of it."""

Float = NDArray[np.float64]


def _by_momentum(intensity: Intensity, momentum: Float, cos_zenith: float) -> tuple[Float, Float]:
    """Return J of both charges [1/(m2 s sr GeV/c)]; dE/dp = p / (E + m)."""
    total = np.hypot(momentum, MUON_MASS)
    plus, minus = intensity(total - MUON_MASS, np.asarray(cos_zenith))
    return plus * momentum / total, minus * momentum / total


@dataclass(frozen=True)
class Bess:
    """BESS-TeV: S. Haino et al., Phys. Lett. B 594 (2004) 35; Tsukuba, 30 m above the sea, October 2002.

    Its 65 bins of momentum hold the mean of the flux in the bin, of each charge.
    """

    low: Float
    high: Float
    mean: Float
    """Momentum [GeV/c] of the bin's edges, and the mean one of mu+."""

    flux: Float
    """[charge, bin], mu+ first [1/(m2 s sr GeV/c)]."""

    statistical: Float
    systematic: Float
    """Standard errors of `flux`."""

    @property
    def error(self) -> Float:
        """Both errors together, as if those of different bins were independent."""
        return np.hypot(self.statistical, self.systematic)

    def predicted(self, intensity: Intensity) -> Float:
        """Mean of a flux in each bin, as `flux`, by a rule of Gauss and Legendre."""
        nodes, weights = np.polynomial.legendre.leggauss(5)
        half = (self.high - self.low)[:, None] / 2
        momentum = self.low[:, None] + half * (1 + nodes)
        return np.stack([one @ weights / 2 for one in _by_momentum(intensity, momentum, BESS_COSINE)])


@dataclass(frozen=True)
class L3:
    """L3+C: P. Achard et al., Phys. Lett. B 598 (2004) 15; CERN, 450 m above the sea, 1999 and 2000, vertical."""

    mean: Float
    """Mean momentum [GeV/c] of each bin."""

    flux: Float
    error: Float
    """Of both charges together [1/(m2 s sr GeV/c)], and its total error."""

    ratio: Float
    ratio_error: Float
    """mu+ for each mu-, of the first 12 bins, and its total error."""

    def predicted(self, intensity: Intensity) -> tuple[Float, Float]:
        """Flux and charge ratio at each mean momentum, as `flux` and `ratio`."""
        plus, minus = _by_momentum(intensity, self.mean, 1.0)
        return plus + minus, (plus / minus)[: len(self.ratio)]


def read_bess() -> Bess:
    """Read bess_tev.csv."""
    rows = np.loadtxt(FOLDER / "bess_tev.csv", delimiter=",", skiprows=3)
    return Bess(*rows[:, :3].T, *(rows[:, [column, column + 4]].T for column in (3, 4, 5)))


def read_l3() -> L3:
    """Read l3_cosmic.csv: p^3 J [GeV2/(cm2 s sr)], errors in percent, and no charge ratio (0) above 500 GeV/c."""
    rows = np.loadtxt(FOLDER / "l3_cosmic.csv", delimiter=",", skiprows=3)
    momentum, flux = rows[:, 2], 1e4 * rows[:, 3] / rows[:, 2] ** 3
    ratio, ratio_percent = rows[rows[:, 6] > 0][:, [6, 8]].T
    return L3(momentum, flux, flux * rows[:, 5] / 100, ratio, ratio * ratio_percent / 100)
