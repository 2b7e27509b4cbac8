"""Which muons the families for the flux `measured` are made of: depths of water and rock, numbers, seeds."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from family_plan import sample_name

__all__ = ["DENSITIES", "EQUIVALENTS", "PLAN", "Deep", "depths"]

DENSITIES = {"water": 1.0, "rock": 2.65}
"""Media of the families, and their densities [g/cm3]."""

_KNOTS = (0, 0.1, 0.3, 1, 3, 6, 10, 17, 30, 60, 120, 250, 500, 1000, 2000, 3500, 5000)

EQUIVALENTS = {"water": _KNOTS, "rock": (*_KNOTS, 6625)}
"""Knots of each [m w.e.]: 5,000 m of water, 2,500 m of rock."""

MUONS = 4_000_000
TESTING, TESTING_BETWEEN = 1_000_000, 500_000  # at knots, and halfway between two


@dataclass(frozen=True)
class Deep:
    """Muons of the flux at a depth."""

    name: str
    medium: str
    depth_m: float
    muons: int
    seed: int


def depths(medium: str, *, between: bool) -> tuple[float, ...]:
    """Return the depths [m] of a medium's knots, or also those halfway between, at which the family is tested, too.

    Halfway is meant of ln(m w.e. + 0.7), in which families interpolate.
    """
    knots = EQUIVALENTS[medium]
    halfway = [((one + 0.7) * (other + 0.7)) ** 0.5 - 0.7 for one, other in pairwise(knots)]
    every = sorted({*knots, *(float(f"{one:.2g}") for one in halfway)}) if between else knots
    return tuple(float(f"{one / DENSITIES[medium]:.6g}") for one in every)


def _plan(medium: str, seed: int) -> list[Deep]:
    knots = depths(medium, between=False)
    training = [Deep(sample_name("training", depth), medium, depth, MUONS, seed + n) for n, depth in enumerate(knots)]
    testing = [
        Deep(sample_name("testing", depth), medium, depth, TESTING if depth in knots else TESTING_BETWEEN, seed + n)
        for n, depth in enumerate(depths(medium, between=True), start=1000)
    ]
    return [*training, *testing]


PLAN: dict[str, tuple[Deep, ...]] = {"water": tuple(_plan("water", 910_000)), "rock": tuple(_plan("rock", 920_000))}
"""By medium."""
