"""The command family, and evaluate at a depth, as a user runs them."""

from __future__ import annotations

import subprocess
import sysconfig
from dataclasses import replace
from pathlib import Path

import pytest

from deepmuon_runtime import Generator
from deepmuon_training.export.metadata import Training
from deepmuon_training.generators.fitted import FittedGenerator
from deepmuon_training.sample import write_sample
from deepmuon_training.scores.evaluation import Evaluation

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-train"


def knot(networks: object, sample: object, depth: float, **changes: object) -> FittedGenerator:
    training = replace(Training.of(sample, seed=1), depth_m=depth, **changes)
    return FittedGenerator("quantile", networks, training, {}, (), None)


@pytest.fixture(scope="module")
def folder(quantile, sample, tmp_path_factory) -> Path:
    """Generators of 0, 1 and 4 m, of which the last has no rate, and held-out muons at 2.5 m."""
    folder = tmp_path_factory.mktemp("family")
    for depth in 0, 1, 4:
        knot(quantile, sample, depth, **({"rate": None} if depth == 4 else {})).save(folder / f"{depth}m.pt")
    knot(quantile, sample, 9, medium="standard_rock 2.65 g/cm3").save(folder / "rock.pt")
    (folder / "rates.csv").write_text("depth_m,rate_hz_per_m2,rate_uncertainty_hz_per_m2\n2,120,0.3\n4,110,0.2\n")
    write_sample(folder / "held_out.h5", replace(sample, depth_m=2.5, rate=117.0))
    return folder


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([COMMAND, *words], cwd=folder, capture_output=True, text=True)


def test_generators_become_a_family_that_is_scored_between_them(folder):
    done = run(folder, "family", "4m.pt", "0m.pt", "1m.pt", "--rates", "rates.csv", "-o", "family.onnx")
    assert (done.returncode, done.stderr) == (0, "")
    first, *notes = done.stdout.splitlines()
    assert first.startswith(
        "family.onnx: quantile, 3 knots from 0 to 4 m of G4_WATER, 129.03 to 110.00 muons per m2 and s, "
    )
    assert all(note.startswith("- ") for note in notes)
    assert "that of 1 m is hardest to interpolate" in notes[0]
    model = Generator.open(file=folder / "family.onnx", depth=2, device="cpu").model
    assert model.rate_hz_per_m2 == pytest.approx(120, rel=1e-5)
    assert model.rate_relative_uncertainty == pytest.approx(0.0025)
    options = ["-n", "1e5", "-o", "report.html", "-q"]
    scored = run(folder, "evaluate", "family.onnx", "held_out.h5", "--depth", "2.5", *options)
    assert (scored.returncode, scored.stderr) == (0, "")
    assert "quantile, 2.5 m of water" in (folder / "report.html").read_text()
    options = ["--surface", "sphere", "-n", "1.5e5", "-o", "sphere.html", "--json", "sphere.json", "-q"]
    scored = run(folder, "evaluate", "family.onnx", "held_out.h5", "--depth", "2.5", *options)
    assert (scored.returncode, scored.stderr) == (0, "")
    found = Evaluation.from_json((folder / "sphere.json").read_text())
    assert found.surface == 1
    assert "quantile, 2.5 m of water through a sphere" in (folder / "sphere.html").read_text()
    assert max(abs(tail.pull) for tail in found.tails) < 4.5  # its own training muons: alike, and more so
    wrong = run(folder, "evaluate", "family.onnx", "held_out.h5", "--depth", "3", "-o", "other.html")
    assert wrong.returncode == 2
    assert "compare muons of one place" in wrong.stderr


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("0m.pt", "1 knot makes no family"),
        ("0m.pt 0m.pt", "two generators are of 0 m"),
        ("0m.pt 4m.pt", "the rate is unknown at 4 m, and known elsewhere: say it in --rates"),
        ("0m.pt 1m.pt rock.pt", "some generators are under water, and some under rock"),
        ("0m.pt 1m.pt --rates rates.csv", "a rate at 2 m: the generators are of 0 to 1 m"),
        ("0m.pt 1m.pt --rates missing.csv", "missing.csv can't be read: No such file or directory"),
        ("0m.pt rates.csv", "rates.csv is no generator that deepmuon-train fit wrote"),
    ],
)
def test_what_makes_no_family_is_refused_in_one_line(folder, words, complaint):
    done = run(folder, "family", *words.split(), "-o", "none.onnx")
    assert (done.returncode, done.stdout) == (2, "")
    assert complaint in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (folder / "none.onnx").exists()


def test_it_does_not_replace_what_it_reads(folder):
    done = run(folder, "family", "0m.pt", "1m.pt", "-o", "1m.pt", "--overwrite")
    assert done.returncode == 2
    assert FittedGenerator.load(folder / "1m.pt").training.depth_m == 1
