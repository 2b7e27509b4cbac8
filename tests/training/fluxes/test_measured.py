from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_training.fluxes.energy_loss import ionisation_loss
from deepmuon_training.fluxes.measured import MEASURED, intensity
from deepmuon_training.fluxes.plane import plane_rate

COSINES = np.array([0.0, 0.01, 0.1, 0.3, 0.6, 1.0])[:, None]


def total(energy, cos_zenith):
    return np.add(*intensity(np.asarray(energy), np.asarray(cos_zenith)))


@given(st.floats(1e-3, 1e6), st.floats(0, 1))
def test_both_charges_are_there_at_every_energy_and_angle(energy, cosine):
    plus, minus = intensity(np.array(energy), np.array(cosine))
    assert 0 < minus < plus < 50


def test_slow_muons_are_as_rare_as_they_are_quickly_stopped_and_have_one_angular_shape():
    energy = np.geomspace(1e-3, 0.3, 100)
    stopping = total(energy, COSINES) * ionisation_loss(energy)
    below = energy < 0.1
    np.testing.assert_allclose(
        stopping[:, below], np.broadcast_to(stopping[:, :1], stopping.shape)[:, below], rtol=0.01
    )
    shape = stopping / stopping[-1]
    np.testing.assert_allclose(shape[2:], np.broadcast_to(shape[2:, :1], shape[2:].shape), rtol=0.05)


def test_the_logarithm_of_the_flux_has_no_kink_in_the_energy():
    log_energy, step = np.linspace(np.log(1e-3), np.log(1e6), 8001, retstep=True)
    third = np.diff(np.log(total(np.exp(log_energy), COSINES)), 3, axis=1) / step**3
    assert np.abs(third).max() < 1  # a kink of 1e-5 in the slope would give 1.2


def test_the_logarithm_of_the_flux_has_no_kink_in_the_angle_down_to_the_horizon():
    cosine, step = np.linspace(0, 1, 4001, retstep=True)
    third = np.diff(np.log(total(np.geomspace(1e-3, 1e6, 46)[:, None], cosine)), 3, axis=1) / step**3
    assert np.abs(third).max() < 1e5  # a kink of 0.007 in the slope would give 1.1e5


@pytest.mark.parametrize("cosine", [0.1, 0.5, 1.0])
def test_the_charge_ratio_rises_from_slow_muons_to_those_of_kaons(cosine):
    plus, minus = intensity(np.geomspace(1e-3, 1e6, 500), np.array(cosine))
    ratio = plus / minus
    assert np.diff(ratio).min() > -1e-12
    assert ratio[0] < 1.28
    assert 1.4 < ratio[-1] < 1.5


def test_fast_muons_are_more_frequent_near_the_horizon_and_slow_ones_are_not():
    assert total(1e4, 0.1) > 3 * total(1e4, 1.0)
    assert total(1.0, 0.1) < 0.01 * total(1.0, 1.0)


def test_a_square_centimetre_sees_four_fifths_of_a_muon_a_minute():
    per_minute = 60e-4 * plane_rate(MEASURED, MEASURED.energy_min, MEASURED.energy_max)
    assert per_minute == pytest.approx(0.784, abs=0.002)
