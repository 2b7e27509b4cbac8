from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kurtosis

from deepmuon_training.energy_transform import EnergyTransform, box_cox, inverse_box_cox
from deepmuon_training.fluxes.ecomug import sea_level_muons

ENERGIES = np.geomspace(1e-3, 1e5, 100_001).astype(np.float32)  # 1 MeV to 100 TeV
MEANS = st.floats(2.5, 5.0)  # 3.1 at sea level, 3.4 under 50 m of water


@given(mean=MEANS)
@pytest.mark.parametrize("library", [np.asarray, torch.from_numpy])
def test_energies_come_back_to_1e_5_in_float32(library, mean):
    transform = EnergyTransform(mean)
    back = transform.energy(transform.pre_tanh(library(ENERGIES)))
    assert str(back.dtype).endswith("float32")
    np.testing.assert_allclose(np.asarray(back), ENERGIES, rtol=1e-5)


@given(energy=st.floats(1e-3, 1e5), mean=MEANS)
def test_the_inverse_is_exact_in_double_precision(energy, mean):
    transform = EnergyTransform(mean)
    assert transform.energy(transform.pre_tanh(np.float64(energy))) == pytest.approx(energy, rel=1e-13)


def test_the_inverse_box_cox_transformation_is_that_of_the_paper_with_lambda_9_in_mev():
    assert inverse_box_cox(np.float64(1e-3)) == pytest.approx(10 ** (1 / 9), rel=1e-15)
    assert inverse_box_cox(np.float64(1.0)) == pytest.approx(9001 ** (1 / 9), rel=1e-15)
    assert box_cox(np.float64(2.0)) == pytest.approx(511 / 9 * 1e-3, rel=1e-15)


def test_the_mean_of_the_training_muons_goes_to_zero():
    energies = sea_level_muons(10_000, seed=1).kinetic_energy
    transform = EnergyTransform.fit(energies)
    assert np.mean(transform.pre_tanh(energies.astype(np.float64))) == pytest.approx(0, abs=1e-12)


def test_the_feature_is_the_tanh_of_the_deviation_from_the_mean():
    transform = EnergyTransform(3.0)
    energies = torch.tensor([1e-3, 1.0, 1e5], dtype=torch.float64)
    feature = transform.feature(energies)
    assert torch.all(feature.abs() < 1)
    torch.testing.assert_close(transform.energy(torch.atanh(feature)), energies)


def test_the_transformation_tames_the_kurtosis_of_the_spectrum():
    energies = sea_level_muons(200_000, seed=1).kinetic_energy.astype(np.float64)
    assert kurtosis(energies) > 1000
    assert kurtosis(inverse_box_cox(energies)) < 3
