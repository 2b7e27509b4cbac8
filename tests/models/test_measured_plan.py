from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "models"))
from measured_plan import DENSITIES, EQUIVALENTS, PLAN, depths


@pytest.mark.parametrize("medium", list(PLAN))
def test_every_knot_is_trained_and_tested_and_between_two_knots_is_one_test(medium):
    knots, tested = depths(medium, between=False), depths(medium, between=True)
    assert [knot * DENSITIES[medium] for knot in knots] == pytest.approx(EQUIVALENTS[medium], rel=1e-5)
    assert [deep.depth_m for deep in PLAN[medium] if deep.name.startswith("training")] == list(knots)
    assert [deep.depth_m for deep in PLAN[medium] if deep.name.startswith("testing")] == list(tested)
    assert set(knots) <= set(tested)
    places = [tested.index(knot) for knot in knots]
    assert places == list(range(0, 2 * len(knots), 2))


def test_every_sample_has_a_seed_of_its_own():
    seeds = [deep.seed for plan in PLAN.values() for deep in plan]
    assert len(set(seeds)) == len(seeds)


def test_the_families_end_at_5_km_of_water_and_2_5_km_of_rock():
    assert depths("water", between=False)[-1] == 5000
    assert depths("rock", between=False)[-1] == 2500
