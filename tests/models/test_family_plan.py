from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "models"))
from family_plan import KNOTS, PLAN, TESTED, Slab, Surface, sample_name


def test_every_sample_is_made_of_a_set_at_sea_level():
    for part, depths in ("training", KNOTS), ("testing", TESTED):
        for depth in depths:
            step, thickness = PLAN[sample_name(part, depth)], 0.0
            while isinstance(step, Slab):
                thickness += step.thickness
                step = PLAN[step.above]
            assert thickness == pytest.approx(depth)
            assert step.cut_m <= depth


def test_no_muons_are_made_or_carried_with_a_seed_twice():
    seeds = [step.seed for step in PLAN.values()]
    assert len(set(seeds)) == len(seeds)
    surfaces = sorted(step.seed for step in PLAN.values() if isinstance(step, Surface))
    assert min(b - a for a, b in pairwise(surfaces)) > 100  # blocks, each with a seed of its own


def test_what_tests_trains_nothing():
    for name, step in PLAN.items():
        if isinstance(step, Slab):
            assert step.above.partition("-")[0] == name.partition("-")[0]
