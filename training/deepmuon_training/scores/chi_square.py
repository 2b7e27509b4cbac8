"""The chi-square of a comparison, with what it shows when nothing differs."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

__all__ = ["ChiSquare"]


@dataclass(frozen=True)
class ChiSquare:
    """A chi-square and what to make of it.

    Parameters
    ----------
    chi2 : float
        Sum of squared, normalised differences.
    ndf : int
        Degrees of freedom; 0 where there was nothing to compare.
    per_ndf, per_ndf_noise : float or None
        chi2/ndf, and its standard deviation sqrt(2/ndf) around 1 where nothing differs; None for ndf = 0.
    sigma : float or None
        The chi-square as a standard normal deviate: positive for too large, negative for too small.
        By E. B. Wilson and M. M. Hilferty, Proc. Natl. Acad. Sci. 17 (1931) 684.
    """

    chi2: float
    ndf: int
    per_ndf: float | None
    per_ndf_noise: float | None
    sigma: float | None

    @classmethod
    def of(cls, chi2: float, ndf: int) -> ChiSquare:
        """Judge a chi-square with `ndf` degrees of freedom."""
        if ndf == 0:
            return cls(0.0, 0, None, None, None)
        spread = 2 / (9 * ndf)
        sigma = ((chi2 / ndf) ** (1 / 3) - (1 - spread)) / sqrt(spread)
        return cls(float(chi2), int(ndf), float(chi2 / ndf), sqrt(2 / ndf), float(sigma))
