"""The fit, made again: what stands in the package and in the docs is what it gives."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from deepmuon_training.fluxes.measured import FITTED, intensity
from studies.measured_flux import fit
from studies.measured_flux.data import read_bess, read_l3
from studies.measured_flux.smoothness import smoothness


@pytest.fixture(scope="module")
def best():
    return fit.fit()


def test_the_parameters_of_the_package_are_those_of_the_fit(best):
    # Another library's rounding may move the fifth digit.
    assert asdict(FITTED) == pytest.approx(asdict(best.parameters), rel=1e-4)


def test_the_flux_is_what_was_measured_within_what_is_asked():
    assert [score for score in fit.scores(intensity) if not score.kept] == []


def test_the_flux_has_neither_bumps_nor_kinks():
    assert [line for line in smoothness(intensity) if not line[-1]] == []


def test_the_table_of_the_docs_says_what_the_flux_has():
    rows = [line.strip("| ").split(" | ") for line in Path(fit.__file__).with_suffix(".md").read_text().splitlines()]
    scores = [*fit.scores(intensity), *(fit.Score(*line) for line in smoothness(intensity))]
    assert rows[2:] == [[score.what, score.asked, score.found] for score in scores]


def test_a_flux_ten_percent_too_high_or_of_the_wrong_charges_misses_what_is_asked():
    def high(energy, cosine):
        return tuple(1.1 * charge for charge in intensity(energy, cosine))

    def swapped(energy, cosine):
        return intensity(energy, cosine)[::-1]

    assert {score.what.split(":")[0] for score in fit.scores(high) if not score.kept} > {"BESS-TeV, 65 bins"}
    assert len([score for score in fit.scores(swapped) if not score.kept]) == 7


def test_a_kink_in_the_flux_is_found():
    def kinked(energy, cosine):
        factor = np.where(energy > 67, (energy / 67) ** 1e-3, 1.0)
        return tuple(factor * charge for charge in intensity(energy, cosine))

    assert [line for line in smoothness(kinked) if not line[-1]]


def test_the_measured_numbers_are_those_of_the_papers():
    bess, l3 = read_bess(), read_l3()
    assert (len(bess.low), len(l3.mean), len(l3.ratio)) == (65, 14, 12)
    np.testing.assert_array_equal(bess.low[1:49], bess.high[:48])
    assert bess.flux[:, 0].tolist() == [13.4, 12.5]  # the table's first line
    assert bess.flux[:, -1].tolist() == [0.0000256, 0.0000245]
    assert l3.flux[0] == pytest.approx(0.217e4 / 23.18**3)
    assert l3.ratio[-1] == 1.276
