from __future__ import annotations

import hashlib
import json

import onnx
import pytest

from deepmuon_runtime import Generator
from deepmuon_runtime.model.metadata import Model
from deepmuon_training.release.card import card, manifest_entry
from deepmuon_training.release.flux_notes import flux_notes
from deepmuon_training.scores.evaluate import evaluate
from deepmuon_training.scores.scorecard import markdown_scorecard


@pytest.fixture(scope="module")
def evaluation(model, sample):
    generated = Generator.open(file=model, device="cpu", threads=1).sample(100_000, seed=1)
    return evaluate(generated, sample.muons, seed=1)


@pytest.fixture(scope="module")
def text(model, evaluation):
    return card(
        model,
        evaluation,
        command="python make.py --depth 0",
        provenance=("muons drawn", "steps taken out"),
        notes=["Only known to 1 TeV."],
    )


def test_the_manifest_lists_file_hash_size_and_metadata(model):
    entry = manifest_entry(model)
    contents = model.read_bytes()
    assert entry["file"] == model.name
    assert entry["sha256"] == hashlib.sha256(contents).hexdigest()
    assert entry["size"] == len(contents)
    metadata = {p.key: p.value for p in onnx.load(model).metadata_props}
    assert {f"deepmuon.{key}": entry[key] for key in entry if key not in ("file", "sha256", "size")} == metadata


def test_the_runtime_reads_a_manifest_entry(model):
    entry = json.loads(json.dumps(manifest_entry(model)))
    file, sha256, size = entry.pop("file"), entry.pop("sha256"), entry.pop("size")
    described = Model.from_metadata(entry, file, sha256, size)
    assert (described.depth_m, described.name) == (0, model.name)


def test_a_card_says_what_made_the_model_in_order(text):
    assert text.index("1. muons drawn\n1. steps taken out") < text.index("```\npython make.py --depth 0\n```")


def test_a_card_shows_the_manifest_entry(text, model):
    for key, value in manifest_entry(model).items():
        assert f"| {key} | {value} |" in text


def test_a_card_shows_the_scores_by_the_architectures_targets(text, evaluation, architecture):
    assert markdown_scorecard(evaluation, architecture) in text
    assert "100000 generated muons against 100000 held-out ones" in text


def test_a_card_names_every_limit_its_own_first(text):
    limits = text[text.index("## Limits") :].splitlines()[2:]
    assert limits == [f"- {limit}" for limit in ("Only known to 1 TeV.", *flux_notes(None).limits)]


def test_a_card_credits_the_source_of_the_muons(text):
    assert flux_notes(None).credit in text
