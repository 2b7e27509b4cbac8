from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.fluxes.ecomug import ecomug
from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.fluxes.plane import plane_rate
from deepmuon_training.underground.integration import PRECISION, plane_integral, vertical_integral
from deepmuon_training.underground.overburden import overburden
from deepmuon_training.underground.place import place
from deepmuon_training.underground.workers import Workers

FIVE_SIGMA = 5  # an error is itself known within a fifth, from 12 batches: one false alarm in a thousand


def test_under_ten_metres_of_water_the_rate_is_that_of_geant4(workers):
    found = plane_integral(place(ecomug(), overburden("water"), 10), workers, seed=1)
    geant4, error = 51.579, 0.045  # of 2,000,000 muons of EcoMug's formula
    assert abs(found.value - geant4) < FIVE_SIGMA * np.hypot(found.error, error)
    assert found.error <= PRECISION * found.value


def test_under_a_millimetre_of_water_the_rate_is_that_of_the_flux(workers, under_water):
    found = plane_integral(under_water(1e-3), workers, seed=1)
    at_sea_level = plane_rate(MEASURED, 1e-3, 1e5)
    assert abs(found.value / at_sea_level - 1) < 5e-3  # some muons of 1 MeV stop, some of more come below it


def test_a_seed_gives_the_same_integral_for_any_number_of_processes(under_water, kilometre):
    with Workers(overburden("water"), 2) as two:
        again = plane_integral(under_water(1000), two, seed=1)
    assert again.value == kilometre.value
    assert again.error == kilometre.error
    np.testing.assert_array_equal(again.weights, kilometre.weights)


def test_another_seed_gives_another_integral_within_the_errors(workers, under_water, kilometre):
    other = plane_integral(under_water(1000), workers, seed=2)
    assert other.value != kilometre.value
    assert abs(other.value - kilometre.value) < FIVE_SIGMA * np.hypot(other.error, kilometre.error)


def test_the_mean_of_the_weights_is_the_integral(kilometre):
    assert kilometre.weights.mean() == pytest.approx(kilometre.value, rel=1e-12)
    assert 0.5 < kilometre.positive < 0.6
    assert 150 < kilometre.mean_energy < 250


def test_twice_the_density_is_twice_the_depth(under_water, kilometre):
    dense = overburden("water", 2.0)
    with Workers(dense, 1) as workers:
        found = plane_integral(place(MEASURED, dense, 500), workers, seed=3)
    assert abs(found.value - kilometre.value) < FIVE_SIGMA * np.hypot(found.error, kilometre.error)


def test_vertical_muons_are_those_of_the_plane_with_a_zenith_of_three_degrees_at_most(workers, under_water, kilometre):
    vertical = vertical_integral(under_water(1000), workers, seed=1)
    near = kilometre.trials.cos_zenith > 0.99  # where it hardly changes
    intensity = kilometre.weights * near / (np.pi * (1 - 0.99**2))
    error = intensity.std() / np.sqrt(len(intensity))
    assert abs(intensity.mean() - vertical.value) < 0.02 * vertical.value + FIVE_SIGMA * error
    assert vertical.trials.cos_zenith.min() >= 0.999


def test_a_flux_that_ends_below_what_the_depth_takes_is_refused():
    low = replace(MEASURED, name="low", energy_max=300.0)
    with pytest.raises(RefusedError, match=r"the flux low ends at 300 GeV, and 1000 m of water take 31\d"):
        place(low, overburden("water"), 1000)


def test_a_flux_that_ends_where_many_of_the_muons_come_from_is_refused(workers):
    low = replace(MEASURED, name="low", energy_max=1000.0)
    with pytest.raises(RefusedError, match=r"low ends at 1000 GeV, and \d+% of the muons 1000 m deep come from its"):
        plane_integral(place(low, overburden("water"), 1000), workers, seed=1)


@pytest.mark.parametrize("depth", [0.0, -1.0, np.inf, np.nan])
def test_what_is_no_depth_is_refused(depth):
    with pytest.raises(RefusedError, match="a positive number of metres"):
        place(MEASURED, overburden("water"), depth)


def test_what_is_no_overburden_is_refused():
    with pytest.raises(RefusedError, match="'ice' is unknown here: expected was water or rock"):
        overburden("ice")
    with pytest.raises(RefusedError, match="a density of 0 g/cm3"):
        overburden("rock", 0)
