from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from deepmuon_training.export.family_export import export_family
from deepmuon_training.export.metadata import Training
from deepmuon_training.families.rates import KnownRate
from deepmuon_training.generators.quantile.family import quantile_family
from deepmuon_training.release.card import manifest_entry
from deepmuon_training.release.family_card import family_card
from deepmuon_training.release.flux_notes import flux_notes
from deepmuon_training.scores.model_evaluation import evaluate_model


@pytest.fixture(scope="module")
def knots(sample) -> list[Training]:
    known = Training.of(sample, seed=1)
    return [replace(known, depth_m=depth, provenance=(f"to {depth:g} m",)) for depth in (0.0, 2.0)]


@pytest.fixture(scope="module")
def file(quantile_tables, knots, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("family") / "water.onnx"
    rates = [KnownRate(knot.depth_m, 129.0, 0.2) for knot in knots]
    export_family(quantile_family([(knot.depth_m, quantile_tables) for knot in knots], 1.0, rates), knots, 0.002, path)
    return path


@pytest.fixture(scope="module")
def text(file, knots, sample) -> str:
    evaluations = {}
    for depth in 1.0, 0.0:
        held_out = replace(sample, depth_m=depth)
        for surface, muons in ((1, 150_000), (0, 100_000)):
            evaluations[depth, surface] = evaluate_model(file, held_out, muons, seed=1, depth=depth, surface=surface)
    return family_card(file, knots, evaluations, command="python make_family.py", notes=["Dense near the surface."])


def test_a_familys_card_says_its_range_knots_and_muons(text, knots, file):
    assert text.startswith("# quantile, 0 to 2 m of water\n")
    assert "(G4_WATER in its samples)" in text
    for knot in knots:
        assert f"| {knot.depth_m:g} | 100,000 | 129.035 ± 0.25 |" in text
    for key, value in manifest_entry(file).items():
        assert f"| {key} | {value} |" in text


def test_its_scores_are_in_the_order_of_depth_and_say_which_are_of_knots(text):
    rows = [line for line in text.splitlines() if "| 100,000 | 100,000 |" in line]
    assert [row.split("|")[1:3] for row in rows] == [[" 0 ", " knot "], [" 1 ", " between "]]


def test_its_muons_through_a_sphere_have_scores_of_their_own(text):
    plane, sphere = text.split("Muons through a sphere")
    assert plane.count("| between |") == sphere.count("| between |") == 1
    row = next(line for line in sphere.splitlines() if line.startswith("| 0 | knot |"))
    found, rate = int(row.split("|")[3].replace(",", "")), float(row.split("|")[-2])
    assert 100_000 < found < 120_000  # the mean of cos zenith is 0.75
    assert abs(rate - 1) < 0.01


def test_it_ends_with_its_limits(text):
    assert "1. to 2 m\n" in text
    assert "```\npython make_family.py\n```" in text
    assert text.index("- Dense near the surface.") < text.index(f"- {flux_notes(None).limits[0]}")
