"""CRY's own muons, and what smoothing makes of them."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from deepmuon_runtime.muons import Muons
from deepmuon_training.data.cry import CRY_SHOWER_VARIANCE, HELD_OUT_CRY_MUONS, read_cry
from deepmuon_training.data.smoothing import StepSmoother
from deepmuon_training.sample import Sample
from deepmuon_training.scores.histograms import compare_cells, compare_charge, count_muons


@pytest.fixture(scope="module")
def cry_file() -> Path:
    name = os.environ.get("DEEPMUON_CRY")
    if name is None and "CI" in os.environ:
        pytest.fail("DEEPMUON_CRY does not name the file of CRY's sea-level muons, which CI has to have")
    if name is None:
        pytest.skip("needs CRY's sea-level muons, an HDF5 file that DEEPMUON_CRY names")
    return Path(name)


@pytest.fixture(scope="module")
def held_out(cry_file: Path) -> Sample:
    return read_cry(cry_file, slice(-HELD_OUT_CRY_MUONS, None))


@pytest.fixture(scope="module")
def smoothed(cry_file: Path, held_out: Sample) -> Muons:
    return StepSmoother(read_cry(cry_file, slice(-HELD_OUT_CRY_MUONS)).muons)(held_out.muons)


def test_the_rate_is_that_of_crys_live_time(held_out):
    # 8,000,000 muons in a box of 100 m; 3 in 2,000,000 have less than 1 MeV.
    assert held_out.rate == pytest.approx(8e6 / 7.217963 / 100**2, rel=1e-5)
    assert held_out.rate_uncertainty == pytest.approx(held_out.rate * np.sqrt(CRY_SHOWER_VARIANCE / 8e6), rel=1e-5)


def test_the_azimuth_is_uniform(held_out):
    muons = held_out.muons
    phase = (muons.u + 1j * muons.v) / np.hypot(muons.u, muons.v)
    chi2 = sum(2 * len(phase) * abs(np.mean(phase**k)) ** 2 for k in range(1, 5)) / CRY_SHOWER_VARIANCE
    assert stats.chi2.sf(chi2, 8) > 1e-4  # the false-alarm rate


def test_smoothing_keeps_what_is_in_the_cells(held_out, smoothed):
    raw, smooth = count_muons(held_out.muons), count_muons(smoothed)
    # They are the same muons: independent ones of the same distribution would show 1.
    assert compare_cells(smooth, raw).chi_square.per_ndf < 0.2
    assert compare_charge(smooth, raw).per_ndf < 0.2


def jumps(muons: Muons) -> NDArray[np.float64]:
    """By how much log density jumps at CRY's cell edges from 0.4 to 16 GeV, beyond what it does beside them."""
    counts = np.histogram(np.log10(muons.kinetic_energy), 0.025 * np.arange(-24, 65))[0]
    steps = np.diff(np.log(counts))  # step k is at the edge -0.575 + 0.025 k
    at_edges = np.arange(7, len(steps) - 8, 8)
    return steps[at_edges] - (steps[at_edges - 1] + steps[at_edges + 1]) / 2


def test_smoothing_takes_the_steps_out_of_the_spectrum(held_out, smoothed):
    assert np.sqrt(np.mean(jumps(held_out.muons) ** 2)) > 0.1
    assert np.sqrt(np.mean(jumps(smoothed) ** 2)) < 0.02
