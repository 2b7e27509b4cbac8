"""Which muons the family for CRY through water is made of: sets at sea level, slabs, seeds.

A Surface is a set of CRY 1.7's muons at sea level: 100 m box, latitude 30.5, altitude 0, 7-1-2012, in blocks of
4,000,000 (10,000,000 where it has a cut), block i with CRY's seed `seed + i`. Where `cut_m` is not 0, only muons with
E |w| of at least 0.17 GeV a metre are kept, at the rate of these: no others arrive there.
A Slab carries all muons of `above` on to `depth_m`. Samples of one chain of slabs are correlated between depths.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

__all__ = ["CUT", "KNOTS", "PLAN", "TESTED", "Slab", "Surface", "sample_name"]

KNOTS = (0, 0.1, 0.3, 1, 3, 6, 10, 20, 30, 40, 50, 70, 100)
"""Depths [m] of the family's generators."""

BETWEEN = (0.2, 0.5, 2, 4.5, 8, 14, 25, 35, 60, 85)
"""Depths [m] at which it is scored between them."""

TESTED = tuple(sorted((*KNOTS, *BETWEEN)))

CUT = 0.17
"""E |w| [GeV] for each metre of depth that a muon needs at sea level, at least: it loses 0.18 and more."""


@dataclass(frozen=True)
class Surface:
    """Muons of CRY at sea level, so many made."""

    name: str
    seed: int
    muons: int
    cut_m: float = 0.0


@dataclass(frozen=True)
class Slab:
    """Muons carried from one depth to the next."""

    name: str
    above: str
    top_m: float
    depth_m: float
    seed: int

    @property
    def thickness(self) -> float:
        """Return the metres of water between."""
        return round(self.depth_m - self.top_m, 6)

    @property
    def muons_per_part(self) -> int:
        """Muons carried with one seed: the survivors depend on it."""
        return 250_000 if self.thickness >= 20 else 500_000


def sample_name(part: str, depth_m: float) -> str:
    """Return the name of a sample; part is training or testing."""
    return f"{part}-{depth_m:g}m"


def _chain(part: str, surface: str, depths: tuple[float, ...], seed: int) -> list[Slab]:
    names = [surface, *(sample_name(part, depth) for depth in depths)]
    tops = pairwise((0.0, *depths))
    return [
        Slab(name, above, top, depth, seed + number)
        for number, ((above, name), (top, depth)) in enumerate(zip(pairwise(names), tops, strict=True))
    ]


PLAN: dict[str, Surface | Slab] = {
    step.name: step
    for step in (
        Surface("training-0m", 71_000_000, 12_300_000),
        *_chain("training", "training-0m", (0.1, 0.3, 1, 3, 6, 10), 711_000),
        Surface("training-surface-20m", 72_000_000, 38_000_000, 20),
        *_chain("training", "training-surface-20m", (20, 30), 712_000),
        Surface("training-surface-40m", 73_000_000, 80_000_000, 40),
        *_chain("training", "training-surface-40m", (40, 50), 713_000),
        Surface("training-surface-70m", 74_000_000, 180_000_000, 70),
        *_chain("training", "training-surface-70m", (70, 100), 714_000),
        Surface("testing-surface-2m", 75_000_000, 4_600_000),
        *_chain("testing", "testing-surface-2m", (2,), 715_000),
        Surface("testing-surface-14m", 76_000_000, 10_700_000, 14),
        *_chain("testing", "testing-surface-14m", (14,), 716_000),
        Surface("testing-surface-20m", 82_000_000, 31_000_000, 20),
        *_chain("testing", "testing-surface-20m", (20, 25, 30, 35), 812_000),
        Surface("testing-surface-40m", 83_000_000, 40_000_000, 40),
        *_chain("testing", "testing-surface-40m", (40, 50, 60, 70, 85, 100), 813_000),
        Surface("testing-0m", 81_000_000, 4_000_000),
        *_chain("testing", "testing-0m", (0.1, 0.2, 0.3, 0.5, 1, 3, 4.5, 6, 8, 10), 811_000),
    )
}
"""By name."""
