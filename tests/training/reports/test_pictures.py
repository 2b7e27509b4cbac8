from __future__ import annotations

from dataclasses import replace
from math import log

import pytest
from matplotlib.image import imread

from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.reports.pictures import draw_charge, draw_energy, draw_pictures, draw_zenith
from deepmuon_training.scores.evaluate import evaluate
from deepmuon_training.scores.evaluation import Evaluation


@pytest.fixture(scope="module")
def evaluation() -> Evaluation:
    return evaluate(sea_level_muons(120_000, seed=1), sea_level_muons(110_000, seed=2), seed=3)


def test_three_pictures_are_drawn(evaluation, tmp_path):
    paths = draw_pictures(evaluation, tmp_path, "10 m, quantile")
    assert [path.name for path in paths] == ["energy.png", "zenith.png", "charge.png"]
    for path in paths:
        picture = imread(path)
        assert picture.shape[:2] == (750, 900)
        assert picture[..., :3].std() > 0.05  # not blank


def test_one_evaluation_gives_the_same_bytes(evaluation, tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    for a, b in zip(draw_pictures(evaluation, first), draw_pictures(evaluation, second), strict=True):
        assert a.read_bytes() == b.read_bytes()


@pytest.mark.parametrize("draw", [draw_energy, draw_zenith, draw_charge])
def test_a_picture_has_a_ratio_panel_around_one(evaluation, draw):
    upper, lower = draw(evaluation, "title").axes
    low, high = lower.get_ylim()
    assert upper.get_title() == "title"
    assert lower.get_ylabel() == "ratio"
    assert (low + high) / 2 == pytest.approx(1)
    assert lower.get_xlim() == upper.get_xlim()


def test_the_density_of_energy_is_of_unit_integral(evaluation):
    (line,) = [patch for patch in draw_energy(evaluation).axes[0].patches if not patch.get_fill()]
    values, edges, _ = line.get_data()
    filled = values == values
    logs = edges[1:] / edges[:-1]
    total = sum(value * log(ratio) for value, ratio in zip(values[filled], logs[filled], strict=True))
    assert 0.97 < total < 1  # the rest lies outside, or in bins too thin to draw


def test_a_charge_that_is_never_positive_can_be_drawn(evaluation, tmp_path):
    nothing = (0,) * 52
    held_out = replace(evaluation.held_out_spectra, plus_by_energy=nothing)
    draw_pictures(replace(evaluation, held_out_spectra=held_out), tmp_path)
