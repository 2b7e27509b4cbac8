from __future__ import annotations

from dataclasses import replace

import pytest

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.export.metadata import Training
from deepmuon_training.families.rates import KnownRate
from deepmuon_training.generators.family import check_knots, family_of
from deepmuon_training.generators.fitted import FittedGenerator


@pytest.fixture(scope="module")
def knot(quantile, sample) -> FittedGenerator:
    return FittedGenerator("quantile", quantile, Training.of(sample, seed=1), {}, (), None)


def at(knot: FittedGenerator, depth: float, **changes: object) -> FittedGenerator:
    return replace(knot, training=replace(knot.training, depth_m=depth, **changes))


def test_knots_may_come_in_any_order_and_keep_their_rates(knot):
    found = family_of([at(knot, 5, rate=60.0, rate_uncertainty=1.2), at(knot, 0), at(knot, 1, rate=110.0)])
    assert found.family.depths == (0, 1, 5)
    assert [training.depth_m for training in found.knots] == [0, 1, 5]
    assert found.family.rate(0) == pytest.approx(knot.training.rate)
    assert found.family.rate(5) == pytest.approx(60)
    assert str(found) == "quantile, 3 knots from 0 to 5 m of G4_WATER, 129.03 to 60.00 muons per m2 and s"
    assert any(note.startswith("5 m: ") for note in found.notes)


def test_further_rates_are_used_and_come_first_at_a_knot(knot):
    knots = [at(knot, 0), at(knot, 2, rate=None)]
    found = family_of(knots, [KnownRate(2, 100.0), KnownRate(0, 125.0), KnownRate(0.5, 120.0)])
    for depth, rate in (0, 125), (0.5, 120), (2, 100):
        assert found.family.rate(depth) == pytest.approx(rate)


def test_without_any_rate_a_family_has_none(knot):
    assert family_of([at(knot, 0, rate=None), at(knot, 2, rate=None)]).family.rate(1) is None


def test_a_rate_that_is_known_in_part_or_out_of_range_is_refused(knot):
    with pytest.raises(RefusedError, match="the rate is unknown at 2 m, and known elsewhere: say it in --rates"):
        family_of([at(knot, 0), at(knot, 2, rate=None)])
    with pytest.raises(RefusedError, match="a rate at 3 m: the generators are of 0 to 2 m"):
        family_of([at(knot, 0), at(knot, 2)], [KnownRate(3, 1.0)])
    with pytest.raises(RefusedError, match="two rates are of one depth"):
        family_of([at(knot, 0), at(knot, 2)], [KnownRate(1, 1.0), KnownRate(1, 2.0)])


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"depth_m": 0.0}, "two generators are of 0 m: a family has one knot at a depth"),
        ({"medium": "standard_rock 2.65 g/cm3"}, "some generators are under water, and some under rock"),
        ({"flux": "cry"}, "some generators are of an unknown flux, and some of cry"),
        ({"charge": 1}, "some generators are of muons of both charges, and some of muons of charge \\+1"),
    ],
)
def test_knots_that_differ_in_more_than_the_depth_are_refused(knot, changes, complaint):
    trainings = [
        knot.training,
        replace(knot.training, depth_m=5.0),
        replace(knot.training, **{"depth_m": 9.0, **changes}),
    ]
    with pytest.raises(RefusedError, match=complaint) as refused:
        check_knots(["quantile"] * 3, trainings)
    assert "\n" not in str(refused.value)


def test_the_overburden_of_sea_level_has_no_name(knot):
    rock = {"medium": "standard_rock 2.65 g/cm3"}
    check_knots(["quantile"] * 2, [knot.training, replace(knot.training, depth_m=5.0, **rock)])


def test_one_knot_and_other_architectures_are_refused(knot):
    with pytest.raises(RefusedError, match="1 knot makes no family: two generators of different depths are the fewest"):
        family_of([knot])
    both = [knot.training, replace(knot.training, depth_m=5.0)]
    with pytest.raises(RefusedError, match="a transformer makes no family"):
        check_knots(["transformer"] * 2, both)
    with pytest.raises(RefusedError, match="some generators are quantile, and some transformer"):
        check_knots(["quantile", "transformer"], both)
