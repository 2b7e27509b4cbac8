"""One score in short: a number, what alike samples show, and what is made of it."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

from deepmuon_training.scores.chi_square import ChiSquare

__all__ = ["Score"]

_SIGMAS = 3.0


@dataclass(frozen=True)
class Score:
    """One line of the scorecard.

    Parameters
    ----------
    name : str
        No two scores of an evaluation have the same up to the first comma.
    value : float or None
        What was measured; None where it is not defined.
    expected, noise : float or None
        Mean and standard deviation of the value for two alike samples of these sizes.
    sigma : float or None
        The value as a standard normal deviate, where its noise is one.
    deviation : float or None
        How far the value is from what is expected, without sign; of a KS distance all of it.
    margin : float or None
        How far noise alone may take it: three standard deviations, and of a KS distance its 1 % level.
    excess : float or None
        How far beyond that margin it is; negative within.
    in_quadrature : bool
        Whether deviation, margin and excess are sides of a right triangle (delta), not lengths on one line.
    noise_unknown : bool
        Whether a part of the noise is not known; `noise` is then the known one, if there is any.
    target : str or None
        What was asked, in words.
    effective_limit : float or None
        The smallest deviation that is called missed: the target's limit and the noise.
    verdict : str or None
        "met", "missed", "too few muons to tell" or "not measured" where there is a target; else "alike" or
        "differs ...".
    """

    name: str
    value: float | None
    expected: float | None = None
    noise: float | None = None
    sigma: float | None = None
    deviation: float | None = None
    margin: float | None = None
    excess: float | None = None
    in_quadrature: bool = False
    noise_unknown: bool = False
    target: str | None = None
    effective_limit: float | None = None
    verdict: str | None = None

    @classmethod
    def of(
        cls, name: str, value: float | None, expected: float | None, noise: float | None, sigma: float | None = None
    ) -> Score:
        """Make a score whose excess is its deviation less three standard deviations."""
        if value is None or expected is None or noise is None:
            return cls(name, value, expected, noise, sigma)
        deviation, margin = abs(value - expected), _SIGMAS * noise
        return cls(name, value, expected, noise, sigma, deviation, margin, deviation - margin)

    @classmethod
    def of_chi_square(cls, name: str, chi_square: ChiSquare) -> Score:
        """Make a score of chi2/ndf; one that is too small has no excess."""
        score = cls.of(name, chi_square.per_ndf, 1.0, chi_square.per_ndf_noise, chi_square.sigma)
        if score.value is None or score.margin is None:
            return score
        deviation = max(0.0, score.value - 1)
        return cls(name, score.value, 1.0, score.noise, score.sigma, deviation, score.margin, deviation - score.margin)

    @classmethod
    def of_delta(cls, name: str, delta: float, noise: float) -> Score:
        """Make a score of a relative difference beyond noise, `noise` being what a standard deviation feigns.

        Its square is linear in chi2, so that three standard deviations are taken off there.
        """
        excess = sqrt(max(0.0, delta**2 - _SIGMAS * noise**2))
        margin = sqrt(_SIGMAS) * noise
        return cls(name, delta, 0.0, noise, None, delta, margin, excess, in_quadrature=True)

    @property
    def met(self) -> bool | None:
        """Whether its target is; None where there is none, or that can't be told."""
        return {"met": True, "missed": False}.get(self.verdict or "")
