from __future__ import annotations

import pytest
from scipy import stats

from deepmuon_training.scores.chi_square import ChiSquare


@pytest.mark.parametrize(("ndf", "accuracy"), [(8, 0.1), (24, 0.05), (400, 0.01), (20_000, 0.001)])
@pytest.mark.parametrize("sigma", [-3, -1, 0, 1, 3, 4])
def test_sigma_is_the_normal_deviate_of_the_same_probability(ndf, accuracy, sigma):
    chi2 = stats.chi2.isf(stats.norm.sf(sigma), ndf)
    assert ChiSquare.of(chi2, ndf).sigma == pytest.approx(sigma, abs=accuracy)


def test_the_noise_of_chi2_per_ndf_is_its_standard_deviation():
    assert ChiSquare.of(30.0, 25).per_ndf == pytest.approx(1.2)
    assert ChiSquare.of(30.0, 25).per_ndf_noise == pytest.approx(stats.chi2.std(25) / 25)


def test_nothing_compared_is_no_number():
    assert ChiSquare.of(0.0, 0) == ChiSquare(0.0, 0, None, None, None)
