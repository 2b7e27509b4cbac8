from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import MU_MINUS, Muons
from deepmuon_training.fluxes.ecomug import sea_level_muons
from deepmuon_training.scores.evaluate import FEWEST_MUONS, evaluate
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.score import Score
from deepmuon_training.scores.scorecard import markdown_scorecard, scorecard, table_rows
from deepmuon_training.scores.targets import judge

EVALUATIONS = sorted((Path(__file__).parents[3] / "docs" / "evaluations").glob("*.json"))
assert EVALUATIONS


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
        assert score.excess is None or score.excess <= 0, score
        assert score.verdict in (None, "alike")
    assert (clean.generated_muons, clean.held_out_muons) == (300_000, 200_000)


def test_a_clean_pair_meets_every_target_that_its_size_can_tell(clean):
    judged = [score for score in scorecard(clean, "quantile") if score.target]
    assert len(judged) > 20
    verdicts = {score.name: score.verdict for score in judged}
    assert set(verdicts.values()) == {"met", "too few muons to tell"}
    assert verdicts["tail above 1 TeV"] == verdicts["cos zenith 0 to 0.05"] == "too few muons to tell"
    assert verdicts["charge by cell: chi2/ndf"] == verdicts["repeated muons"] == "met"


@pytest.mark.parametrize("path", EVALUATIONS, ids=lambda path: path.stem)
def test_no_two_scores_of_a_released_model_share_the_beginning_of_their_name(path):
    names = [score.name.split(",")[0] for score in scorecard(Evaluation.from_json(path.read_text()))]
    assert len(set(names)) == len(names)
    for column in "log10 E", "cos zenith":
        assert f"independence: variance of means of 16 of {column}" in names


def test_every_judged_score_says_its_effective_limit(clean):
    for score in scorecard(clean, "quantile"):
        if score.target and score.verdict != "not measured":
            assert score.effective_limit is not None
    rows = {row[0]: row for row in table_rows(scorecard(clean, "quantile"))}
    tail = next(score for score in scorecard(clean, "quantile") if score.name == "tail above 1 TeV")
    assert rows["tail above 1 TeV"][6] == f"± {0.05 + 3 * tail.noise:.2g}"


def without(muons: Muons, low: float, high: float, share: float) -> Muons:
    """Leave out a share of the muons between two cosines of the zenith angle."""
    there = (muons.cos_zenith > low) & (muons.cos_zenith < high)
    return muons[~(there & (np.random.default_rng(1).random(len(muons)) < share))]


def test_opposite_errors_near_the_horizon_are_seen_each(truth):
    flat = sea_level_muons(600_000, seed=2)
    spoiled = without(flat, 0.1, 0.2, 0.4)
    again = flat[(flat.cos_zenith < 0.1)]
    generated = Muons.concatenate([spoiled, again, again, again])
    card = {score.name: score for score in scorecard(evaluate(generated, truth, seed=1), "quantile")}
    pooled = card["tail cos zenith below 0.2"]
    assert card["cos zenith 0.05 to 0.1"].value > 3
    assert card["cos zenith 0.05 to 0.1"].verdict == "missed"
    assert card["cos zenith 0.15 to 0.2"].value == pytest.approx(0.6, abs=0.1)
    assert card["cos zenith 0.15 to 0.2"].verdict == "missed"
    assert abs(pooled.value - 1) < 0.4 * abs(card["cos zenith 0.05 to 0.1"].value - 1)


def test_held_out_muons_in_showers_have_the_noise_that_was_stated(truth):
    generated = sea_level_muons(200_000, seed=2)
    alone, showers = (evaluate(generated, truth, seed=5, variance_factor=v) for v in (1.0, 3.0))
    for name in ("KS energy", "tail above 100 GeV", "cos zenith 0.1 to 0.15"):
        noises = [next(s.noise for s in scorecard(e) if s.name == name) for e in (alone, showers)]
        assert noises[1] / noises[0] == pytest.approx(np.sqrt(2))  # of equal samples: (1 + 3) / (1 + 1)
    assert showers.cells.chi_square.chi2 == pytest.approx(alone.cells.chi_square.chi2 / 2)
    with pytest.raises(RefusedError, match="the variance factor is 0"):
        evaluate(generated, truth, seed=5, variance_factor=0)


def test_an_unknown_uncertainty_is_called_so_and_the_known_one_is_kept(truth):
    generated = sea_level_muons(FEWEST_MUONS, seed=2)

    def rate(own: float | None, others: float | None) -> tuple[str, ...]:
        found = evaluate(generated, truth, seed=1, generated_rate=(110.8, own), truth_rate=(110.7, others))
        assert Evaluation.from_json(found.to_json()) == found
        return next(row for row in table_rows(scorecard(found)) if row[0].startswith("rate"))

    assert rate(None, None)[2:4] == ("110.7 ± unknown", "")
    assert rate(0.06, None)[2:4] == rate(None, 0.06)[2:4] == ("110.7 ± 0.06 and unknown", "")
    assert rate(0.06, 0.08)[2] == "110.7 ± 0.1"


def test_a_missed_target_is_reported_and_raises_nothing(faulty):
    missed = {score.name for score in scorecard(faulty, "quantile") if score.met is False}
    assert {
        "KS energy",
        "cells: delta",
        "tail above 100 GeV",
        "charge ratio",
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
    assert any(line.startswith("| KS energy | 0.00") and "| excess ≤ 0.0007 | ± 0.0" in line for line in lines)


def test_an_architecture_is_judged_by_its_own_targets(clean):
    targets = [score.target for score in scorecard(clean, "transformer") if score.target]
    assert targets == ["≤ 0.006"]
    assert all(score.target is None for score in scorecard(clean))


def test_an_architecture_without_targets_gets_a_neutral_verdict(clean, faulty):
    assert {score.verdict for score in scorecard(clean, "diffusion")} == {None, "alike"}
    verdicts = {score.name: score.verdict or "" for score in scorecard(faulty, "diffusion")}
    assert re.fullmatch(r"differs by \d+ sigma", verdicts["charge ratio"])
    assert verdicts["KS energy"] == "differs"
    assert not {"met", "missed"} & {*verdicts.values()}


@pytest.mark.parametrize(
    ("score", "verdict"),
    [
        (Score.of("tail above 1 TeV", 5.7, 1.0, 1.7), "too few muons to tell"),  # 4.7 beyond the limit, within noise
        (Score.of("tail above 1 TeV", 1.0, 1.0, 0.2), "too few muons to tell"),
        (Score.of("tail above 1 TeV", 0.92, 1.0, 0.02), "too few muons to tell"),  # 4 sigma, and 2.5 beyond the limit
        (Score.of("tail above 1 TeV", 0.9, 1.0, 0.01), "missed"),
        (Score.of("tail above 1 TeV", 0.975, 1.0, 0.006), "met"),  # 4 sigma, but within the limit
        (Score.of("tail above 1 TeV", 1.06, 1.0, 0.03), "met"),  # beyond the limit by noise
        (Score.of("independence: x", 9.0, 0.0, 1.0, -3.9), "met"),
        (Score.of("independence: x", 9.0, 0.0, 1.0, -4.1), "missed"),
        (Score.of("independence: x", 9.0, 0.0, 1.0, 0.0), "met"),
        (Score.of("classifier: AUC", 0.5031, 0.5, 0.00001), "missed"),
        (Score.of_delta("cells: delta", 0.013, 0.001), "missed"),
        (Score.of_delta("cells: delta", 0.013, 0.005), "too few muons to tell"),
        (Score.of_delta("cells: delta", 0.01, 0.005), "met"),
        (Score("charge by cell: chi2/ndf", None), "not measured"),
        (Score("unphysical muons", 1e-9, 0.0), "missed"),
    ],
)
def test_a_target_is_met_missed_or_not_to_be_told(score, verdict):
    (judged,) = judge([score], "quantile")
    assert judged.verdict == verdict
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
