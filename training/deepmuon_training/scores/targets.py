"""What is asked of a released generator, and whether a score gives it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from math import sqrt
from typing import Literal

from deepmuon_training.scores.score import Score

__all__ = ["TARGETS", "Target", "judge"]

_RESOLVED = 3.0
"""A score whose margin is more than so many times its limit is not resolved: its noise alone is above the limit."""

_NEUTRAL_SIGMA = 3.0


@dataclass(frozen=True)
class Target:
    """Scores whose name matches a shell-style pattern shall have an excess, absolute sigma or value up to a limit."""

    scores: str
    of: Literal["excess", "sigma", "value"]
    limit: float


TARGETS: dict[str, tuple[Target, ...]] = {
    "quantile": (
        Target("KS *", "excess", 0.0007),
        Target("cells*: delta", "excess", 0.012),
        Target("energy bin*", "excess", 0.015),
        Target("cos zenith bin*", "excess", 0.015),
        Target("cos zenith 0 to 0.05", "excess", 0.3),
        Target("cos zenith *", "excess", 0.1),
        Target("tail *", "excess", 0.03),
        Target("charge by cell*", "excess", 0.2),
        Target("charge ratio", "excess", 0.005),
        Target("azimuth*", "excess", 0.5),
        Target("classifier*", "excess", 0.003),
        Target("independence:*", "sigma", 4.0),
        Target("repeated muons", "value", 0.0),
        Target("repeated energies*", "value", 12.0),  # see independence.Repeats
        Target("unphysical muons", "value", 0.0),
    ),
    "transformer": (Target("KS energy", "value", 0.006),),
}
"""By architecture; the first pattern that matches counts. A missed target is reported, and raises nothing."""


def judge(scores: Iterable[Score], architecture: str | None) -> tuple[Score, ...]:
    """Judge scores by the targets of an architecture; one without a target is only told from its noise."""
    targets = TARGETS.get(architecture or "", ())
    return tuple(
        next((_judged(score, target) for target in targets if fnmatchcase(score.name, target.scores)), _neutral(score))
        for score in scores
    )


def _judged(score: Score, target: Target) -> Score:
    words = {"value": "", "excess": "excess ", "sigma": "|sigma| "}[target.of] + f"≤ {target.limit:g}"
    return replace(score, target=words, effective_limit=_effective(score, target), verdict=_verdict(score, target))


def _effective(score: Score, target: Target) -> float | None:
    """Return the smallest deviation that is called missed."""
    if target.of == "sigma":
        return None if score.noise is None else target.limit * score.noise
    if target.of == "value":
        return target.limit - (score.expected or 0.0)
    if score.margin is None:
        return None
    return sqrt(target.limit**2 + score.margin**2) if score.in_quadrature else target.limit + score.margin


def _verdict(score: Score, target: Target) -> str:
    quantity = {"value": score.value, "excess": score.excess, "sigma": score.sigma and abs(score.sigma)}[target.of]
    if quantity is None:  # a ratio whose one number is 0 has no value, and may differ all the same
        return "missed" if score.sigma is not None and abs(score.sigma) > _NEUTRAL_SIGMA else "not measured"
    if quantity > target.limit:
        return "missed"
    if target.of == "excess":
        assert score.margin is not None
        assert score.deviation is not None
        beyond_both = score.deviation > target.limit and quantity > 0
        if score.margin > _RESOLVED * target.limit or beyond_both:
            return "too few muons to tell"
    return "met"


def _neutral(score: Score) -> Score:
    """Say whether a score without a target is within the noise of alike samples."""
    if score.sigma is not None:
        differs = abs(score.sigma) > _NEUTRAL_SIGMA
        return replace(score, verdict=f"differs by {abs(score.sigma):.0f} sigma" if differs else "alike")
    if score.excess is not None:
        return replace(score, verdict="differs" if score.excess > 0 else "alike")
    return score
