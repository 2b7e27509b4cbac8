from __future__ import annotations

import numpy as np

from deepmuon_runtime import Muons


def three_muons() -> Muons:
    energy, u, v, w = np.float32([[1, 2, 3], [0.6, 0, 0], [0, 0.6, 0], [-0.8, -0.8, -1]])
    return Muons(energy, u, v, w, np.int8([13, -13, 13]))


def test_the_charge_is_the_opposite_of_the_particle_numbers_sign():
    assert three_muons().charge.tolist() == [-1, 1, -1]


def test_the_zenith_is_where_a_muon_comes_from():
    assert np.array_equal(three_muons().cos_zenith, np.float32([0.8, 0.8, 1]))


def test_a_selection_keeps_the_columns_together():
    muons = three_muons()
    for selected in (muons[1:], muons[np.array([False, True, True])], muons[np.array([1, 2])]):
        assert selected.kinetic_energy.tolist() == [2, 3]
        assert selected.pdg_id.tolist() == [-13, 13]


def test_parts_joined_are_the_whole():
    muons = three_muons()
    whole = Muons.concatenate([muons[:1], muons[1:]])
    assert len(whole) == 3
    assert np.array_equal(whole.w, muons.w)
