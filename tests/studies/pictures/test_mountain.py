from __future__ import annotations

import numpy as np
import pytest

from deepmuon_training.fluxes.ecomug import sea_level_muons
from studies.pictures.mountain import behind_mountain, rock, skyline


def test_the_mountain_takes_muons_away_from_the_north_only():
    seen = behind_mountain(sea_level_muons(400_000, seed=6))
    from_north = np.abs(np.arctan2(-seen.u, -seen.v))
    low = seen.cos_zenith < 0.7
    north, south = np.sum(low & (from_north < 0.5)), np.sum(low & (from_north > np.pi - 0.5))
    assert 0.01 < north / south < 0.2
    assert skyline(np.array([0.0])) == pytest.approx(np.radians(60))


def test_muons_cross_less_rock_the_steeper_they_are_and_none_above_the_skyline():
    elevation = np.radians([5.0, 30.0, 59.0, 61.0, 90.0])
    thickness = rock(np.zeros(5), -np.cos(elevation), -np.sin(elevation))  # going south: they come from the north
    assert np.all(np.diff(thickness[:3]) < 0)
    assert np.all(thickness[:3] > 0)
    assert np.all(thickness[3:] == 0)
    assert np.all(rock(np.zeros(5), np.cos(elevation), -np.sin(elevation)) < 1e-3)
