"""Whether the azimuth of a sample may be taken as uniform."""

from __future__ import annotations

from scipy.stats import chi2

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.scores.azimuth import harmonic_moments, in_ranges
from deepmuon_training.scores.chi_square import ChiSquare

__all__ = ["FALSE_ALARM", "check_uniform_azimuth", "measure_uniformity"]

FALSE_ALARM = 1e-4
"""How often muons of a uniform azimuth fail the test."""


def measure_uniformity(muons: Muons) -> ChiSquare:
    """Chi-square of the azimuth's harmonics 1 to 4 below 1 GeV, from 1 to 10 GeV, and above, being zero.

    In each energy range, ``2 n sum_k |mean exp(i k azimuth)|^2`` (Rayleigh's statistic, for four harmonics; K. V.
    Mardia and P. E. Jupp, "Directional Statistics", Wiley 2000, section 6.3) has 8 degrees of freedom.
    Assumes independent muons. A range of fewer than 1000 is left out.
    """
    total, ndf = 0.0, 0
    for _, part in in_ranges(muons):
        number, mean, _ = harmonic_moments(part)
        total, ndf = total + 2 * number * float(mean @ mean), ndf + len(mean)
    return ChiSquare.of(total, ndf)


def check_uniform_azimuth(muons: Muons) -> None:
    """Refuse muons whose azimuth is not uniform; of uniform ones, `FALSE_ALARM` are refused by chance.

    Raises
    ------
    RefusedError
        If the chi-square of `measure_uniformity` is so large only once in ten thousand uniform samples.
    """
    found = measure_uniformity(muons)
    limit = float(chi2.isf(FALSE_ALARM, found.ndf)) if found.ndf else 0.0
    if found.chi2 > limit:
        raise RefusedError(
            f"the azimuth is not uniform: chi2 of its harmonics is {found.chi2:.0f} for {found.ndf} degrees of "
            f"freedom, and over {limit:.0f} once in {1 / FALSE_ALARM:.0f} uniform samples: let it be learned "
            "(--azimuth learned)"
        )
