from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import MU_MINUS, Muons
from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.scores.evaluate import FEWEST_MUONS, evaluate
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.scorecard import Score, judge, markdown_scorecard, scorecard


def no_number(text: str) -> float:
    raise AssertionError(f"{text} is not JSON")


@pytest.fixture(scope="module")
def truth() -> Muons:
    return sea_level_muons(200_000, seed=1)


@pytest.fixture(scope="module")
def clean(truth) -> Evaluation:
    chunks = (sea_level_muons(100_000, seed=seed) for seed in (2, 3, 4))
    return evaluate(
        chunks,
        truth,
        seed=5,
        raw_truth=truth[:150_000],
        generated_rate=(110.8, 0.1),
        truth_rate=(110.7, 0.1),
        unphysical_before_mapping=0.01,
    )


@pytest.fixture(scope="module")
def faulty(truth) -> Evaluation:
    """All mu-, no muon above 100 GeV, each muon twice, 10 % more energy, one in a thousand upward."""
    muons = sea_level_muons(150_000, seed=2)
    muons = muons[muons.kinetic_energy < 100]
    muons = replace(
        muons,
        kinetic_energy=muons.kinetic_energy * np.float32(1.1),
        w=np.where(np.arange(len(muons)) % 1000, muons.w, -muons.w),
        pdg_id=np.full_like(muons.pdg_id, MU_MINUS),
    )
    return evaluate(Muons.concatenate([muons, muons]), truth, seed=5)


def test_a_clean_pair_raises_no_alarm(clean):
    # some 30 scores within 4 sigma and four 1 % levels: a false alarm in 25
    for score in scorecard(clean):
        assert score.sigma is None or abs(score.sigma) < 4, score
        assert score.excess is None or score.excess < 0, score
    assert (clean.generated_muons, clean.held_out_muons) == (300_000, 200_000)


def test_a_clean_pair_meets_every_target_that_its_size_can_tell(clean):
    judged = [score for score in scorecard(clean, "quantile") if score.target]
    assert len(judged) > 20
    assert [score.name for score in judged if not score.met] == []


def test_a_missed_target_is_reported_and_raises_nothing(faulty):
    missed = {score.name for score in scorecard(faulty, "quantile") if score.met is False}
    assert {
        "KS energy",
        "cells: delta",
        "tail above 300 GeV",
        "charge by cell: chi2/ndf",
        "classifier: AUC",
        "repeated muons",
        "unphysical muons",
    } <= missed
    assert not {"KS u", "KS v"} & missed
    assert "missed" in markdown_scorecard(faulty, "quantile")


def test_unphysical_muons_are_counted_and_left_out(faulty):
    assert faulty.unphysical.fraction == pytest.approx(0.001, rel=0.02)
    assert faulty.unphysical.not_downward > 0
    assert faulty.generated_muons < 300_000


def test_an_evaluation_survives_json(clean, faulty):
    for evaluation in (clean, faulty):
        text = evaluation.to_json()
        json.loads(text, parse_constant=no_number)
        assert Evaluation.from_json(text) == evaluation


def test_a_vertical_beam_of_one_charge_is_evaluated(truth):
    beam = truth[: FEWEST_MUONS + 1]
    zero = np.zeros_like(beam.u)
    beam = Muons(beam.kinetic_energy, zero, zero, zero - 1, np.full_like(beam.pdg_id, MU_MINUS))
    evaluation = evaluate(beam, beam, seed=1)
    assert Evaluation.from_json(evaluation.to_json()) == evaluation
    by_name = {score.name: score for score in scorecard(evaluation, "quantile")}
    assert by_name["charge by cell: chi2/ndf"].met is None
    assert "not measured" in markdown_scorecard(evaluation, "quantile")


def test_the_table_has_a_row_for_each_score(clean):
    lines = markdown_scorecard(clean, "quantile").splitlines()
    assert len(lines) == 2 + len(scorecard(clean))
    assert len({line.replace(r"\|", "").count("|") for line in lines}) == 1
    assert any(line.startswith("| KS energy | 0.00") and line.endswith("| excess ≤ 0.001 | met |") for line in lines)


def test_an_architecture_is_judged_by_its_own_targets(clean):
    targets = [score.target for score in scorecard(clean, "transformer") if score.target]
    assert targets == ["≤ 0.006"]
    assert all(score.target is None for score in scorecard(clean))


@pytest.mark.parametrize(
    ("score", "met"),
    [
        (Score("KS u", 0.1, excess=0.0009), True),
        (Score("KS u", 0.1, excess=0.0011), False),
        (Score("independence: x", 9.0, sigma=-3.9), True),
        (Score("independence: x", 9.0, sigma=-4.1), False),
        (Score("independence: x", 9.0, sigma=0.0), True),
        (Score("classifier: AUC", 0.5031), False),
        (Score("charge by cell: chi2/ndf", None), None),
    ],
)
def test_a_target_is_met_up_to_its_limit(score, met):
    (judged,) = judge([score], "quantile")
    assert judged.met is met
    assert judged.target


def test_spectra_count_every_muon(clean):
    spectra = clean.generated_spectra
    assert sum(spectra.plus_by_energy) + sum(spectra.minus_by_energy) == sum(spectra.by_cos_zenith) == 300_000


@pytest.mark.parametrize("count", [0, FEWEST_MUONS - 1])
def test_too_few_muons_are_refused(truth, count):
    few = truth[:count]
    with pytest.raises(RefusedError, match=f"{count} physical generated muons"):
        evaluate(few, truth, seed=1)
    with pytest.raises(RefusedError, match=f"{count} physical held-out muons"):
        evaluate(truth, few, seed=1)


def test_no_chunks_are_refused(truth):
    with pytest.raises(RefusedError, match="0 physical generated muons"):
        evaluate(iter(()), truth, seed=1)
