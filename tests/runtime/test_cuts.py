from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime import Cuts, Muons, RefusedError

ENERGIES = st.floats(1e-3, 1e5)
ZENITHS = st.floats(0, 90)


def muons(energy: np.ndarray, cosine: np.ndarray) -> Muons:
    return Muons.of(energy, np.sqrt(1 - cosine**2), 0 * cosine, -cosine, np.full(len(energy), 13))


@given(low=ENERGIES, high=ENERGIES)
def test_bounds_in_float32_are_really_between_those_that_are_asked(low: float, high: float):
    if low < high * (1 - 1e-6):
        least, most = Cuts(energy_min=low, energy_max=high).energies
        assert low <= float(least) < float(most) <= high
        assert float(np.nextafter(least, np.float32(0))) < low
        assert float(np.nextafter(most, np.float32(np.inf))) > high


@given(low=ZENITHS, high=ZENITHS)
def test_muons_are_kept_where_they_are_within_the_bounds(low: float, high: float):
    if low < high - 0.01:
        random = np.random.default_rng(1)
        some = muons(random.uniform(1, 10, 1000), random.uniform(0.001, 1, 1000))
        kept = some[Cuts(energy_min=2, energy_max=5, zenith_min=low, zenith_max=high).keeps(some)]
        angle = np.degrees(np.arccos(kept.cos_zenith.astype(float)))
        assert ((angle >= low - 1e-6) & (angle <= high + 1e-6)).all()
        assert ((kept.kinetic_energy >= 2) & (kept.kinetic_energy <= 5)).all()


def test_a_muon_from_straight_above_is_kept_however_it_is_rounded():
    one = muons(np.ones(1), np.float32([1.0]))
    one.w[:] = np.nextafter(np.float32(-1), np.float32(-2))
    assert Cuts(zenith_max=10).keeps(one).all()


def test_no_cuts_are_none():
    assert not Cuts()
    assert Cuts(energy_min=1)
    assert Cuts().attributes == {}


@pytest.mark.parametrize(
    ("bounds", "reason"),
    [
        ({"energy_min": 5, "energy_max": 4}, "no muon is left: the energy min, 5 GeV, is not below the energy max, 4"),
        ({"energy_min": 5, "energy_max": 5}, "no muon is left"),
        ({"zenith_min": 60, "zenith_max": 30}, "no muon is left: the zenith min, 60 degrees, is not below"),
        ({"zenith_min": 90}, "no muon is left: none comes from a zenith angle of 90 degrees"),
        ({"zenith_max": 0}, "no muon is left: the zenith max is 0 degrees"),
        ({"energy_min": 1 + 1e-12, "energy_max": 1 + 2e-12}, "no muon is left: no float32 is from"),
        ({"energy_min": math.nan}, "the energy min is nan GeV, and should be a finite number from 0 on"),
        ({"energy_max": math.inf}, "the energy max is inf GeV"),
        ({"energy_min": -1}, "the energy min is -1 GeV"),
        ({"zenith_max": 91}, "the zenith max is 91 degrees, and should be from 0 to 90"),
        ({"zenith_min": "1"}, "'1' is no zenith min: give a number of degrees"),
    ],
)
def test_cuts_that_can_not_be_are_refused(bounds, reason):
    with pytest.raises(RefusedError) as refused:
        Cuts(**bounds)
    assert reason in str(refused.value)
