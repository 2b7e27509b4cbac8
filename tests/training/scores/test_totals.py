from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deepmuon_runtime.muons import MU_MINUS, Muons
from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.scores.totals import compare_charge_ratio, compare_rate, count_unphysical, is_physical

RANGE = (1e-3, 1e5)


def with_defects(**columns: dict[int, float]) -> Muons:
    muons = sea_level_muons(1000, seed=1)
    for name, values in columns.items():
        column = getattr(muons, name).copy()
        column[list(values)] = list(values.values())
        muons = replace(muons, **{name: column})
    return muons


@pytest.mark.parametrize(
    ("columns", "reason", "count"),
    [
        (
            {"kinetic_energy": {0: np.nan, 1: np.inf, 2: 0.0, 3: -1.0, 4: 1e-4, 5: 1.1e5}},
            "energy_out_of_range",
            6,
        ),
        ({"u": {0: np.nan, 1: 2.0}}, "not_of_unit_length", 2),
        ({"w": {0: 0.0, 1: np.nan}}, "not_downward", 2),
        ({"pdg_id": {0: 11, 1: 0}}, "unknown_charge", 2),
    ],
)
def test_each_defect_is_counted(columns, reason, count):
    unphysical = count_unphysical(with_defects(**columns), RANGE)
    assert getattr(unphysical, reason) == count
    assert unphysical.fraction == pytest.approx(count / 1000)


def test_an_upward_muon_is_unphysical_though_its_length_is_right():
    muons = sea_level_muons(1000, seed=1)
    unphysical = count_unphysical(replace(muons, w=-muons.w), RANGE)
    assert (unphysical.not_downward, unphysical.not_of_unit_length, unphysical.fraction) == (1000, 0, 1.0)


def test_a_muon_with_two_defects_is_one_muon():
    muons = with_defects(kinetic_energy={3: np.nan}, w={3: 1.0})
    assert count_unphysical(muons, RANGE).fraction == pytest.approx(1 / 1000)
    assert np.flatnonzero(~is_physical(muons, RANGE)).tolist() == [3]


def test_the_ends_of_the_energy_range_are_inside():
    assert is_physical(with_defects(kinetic_energy={0: 1e-3, 1: 1e5}), RANGE).all()


def test_the_charge_ratio_has_its_error_and_its_difference():
    truth, other = sea_level_muons(200_000, seed=1), sea_level_muons(100_000, seed=2)
    clean = compare_charge_ratio(other, truth)
    assert abs(clean.held_out - 1.28) < 4 * clean.held_out_error  # 4 sigma
    assert abs(clean.sigma) < 4
    assert compare_charge_ratio(sea_level_muons(100_000, seed=2, charge_ratio=1.4), truth).sigma > 8


def test_one_charge_alone_has_no_ratio_but_a_difference():
    truth = sea_level_muons(10_000, seed=1)
    minus = replace(truth, pdg_id=np.full_like(truth.pdg_id, MU_MINUS))
    score = compare_charge_ratio(minus, truth)
    assert score.generated is None
    assert score.sigma < -50
    assert compare_charge_ratio(minus, minus).sigma == 0


def test_rates_are_compared_in_the_error_of_both():
    assert compare_rate((10.0, 0.3), (9.0, 0.4)).sigma == pytest.approx(2.0)
    assert compare_rate((10.0, 0.0), (10.0, 0.0)).sigma == 0
    assert compare_rate((10.0, 0.0), (9.0, 0.0)).sigma is None
