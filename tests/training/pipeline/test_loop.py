"""Tiny pipelines from end to end: run, killed, resumed, refused."""

from __future__ import annotations

import csv
import fcntl
import hashlib
import json
import os
import signal
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deepmuon_runtime import Generator, check_file, read_attributes, read_muons
from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.pipeline.checksums import CHECKSUMS
from deepmuon_training.pipeline.loop import Pipeline, plan
from deepmuon_training.pipeline.seeds import step_seed
from deepmuon_training.pipeline.settings import read_pipeline_settings
from deepmuon_training.pipeline.table import as_csv, as_text, rows
from deepmuon_training.sample import read_sample, write_sample
from deepmuon_training.transport.slab_file import transport_file

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-train"

TINY = """
layers = 1
layer_m = 1
muons = 20_000
muons_per_part = 8_000
scored_muons = 100_000

[transformer]
d = 16
batch = 2048
directions = 8
calibration = 20_000
schedule = { steps = 6, averaging = 0.5, validate_every = 2 }
charge = { steps = 6, averaging = 0.5, validate_every = 2 }
"""

# Runs deepmuon-train, and kills it without warning at a certain call of a function, counted from when a file is there.
DOOMED = """
import os, signal, sys
from importlib import import_module
from pathlib import Path

module, name, calls, awaited = sys.argv[1:5]
owner = import_module(module)
*path, name = name.split(".")
for part in path:
    owner = getattr(owner, part)
original, left = getattr(owner, name), int(calls)

def dying(*arguments, **options):
    global left
    if any(Path().glob(awaited)):
        left -= 1
    if left == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return original(*arguments, **options)

setattr(owner, name, dying)
sys.argv = ["deepmuon-train", *sys.argv[5:]]
import_module("deepmuon_training.commands.train").main()
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, truth: Callable[[int, int], Muons], sample) -> Path:
    """A folder with settings, a sample of 20,000 muons at sea level, and 100,000 held-out ones."""
    folder = tmp_path_factory.mktemp("pipeline")
    (folder / "tiny.toml").write_text(TINY)
    (folder / "transformer.toml").write_text(
        f'architecture = "transformer"\n{TINY.replace("layers = 1", "layers = 0")}'
    )
    write_sample(folder / "sea.h5", sample.then("cut", muons=truth(20_000, 1)))
    write_sample(folder / "held_out.h5", sample.then("drawn again", muons=truth(100_000, 2)))
    return folder


def planned(folder: Path, settings: str = "tiny.toml", work: str = "run", **options) -> Pipeline:
    return plan(read_pipeline_settings(folder / settings), folder / "sea.h5", folder / work, **options)


@pytest.fixture(scope="module")
def said(folder: Path) -> list[str]:
    """What the undisturbed run in the folder `run` says."""
    lines: list[str] = []
    pipeline = planned(folder, held_out=[folder / "held_out.h5"])
    pipeline.run(lines.append, progress=False)
    return lines


@pytest.fixture(scope="module")
def run(folder: Path, said: list[str]) -> Path:
    return folder / "run"


def contents(run: Path) -> dict[str, object]:
    """The contents of a run's files: bytes, and for muon files all but when and by what command they were made."""
    found: dict[str, object] = {}
    for path in {*run.iterdir()} - {run / CHECKSUMS}:
        if path.suffix == ".h5":
            attributes = read_attributes(path)
            attributes = {name: attributes[name] for name in attributes.keys() - {"created", "command_line"}}
            muons = read_muons(path)
            found[path.name] = attributes, {name: getattr(muons, name).tobytes() for name in muons.columns}
        else:
            found[path.name] = path.read_bytes()
    return found


def test_a_run_shows_its_plan_then_each_step_then_is_done(said: list[str], run: Path):
    steps = ["quantile-0m.pt", "quantile-0m.onnx", "evaluation-0m.json", "drawn-0m.h5", "muons-1m.h5"]
    steps += ["quantile-1m.pt", "quantile-1m.onnx"]
    assert [line.split()[:2] for line in said[:7]] == [[str(number), name] for number, name in enumerate(steps, 1)]
    for number, name in enumerate(steps, 1):
        began = [line for line in said if line.startswith(f"{number} of 7: ")]
        ended = [line for line in said if line.startswith(f"{name} made in ")]
        assert len(began) == len(ended) == 1
        assert said.index(began[0]) < said.index(ended[0])
    assert said[-3].endswith(" left")  # a fit and an export have been timed by then
    assert {path.name for path in run.iterdir()} == {*steps, "settings.toml", CHECKSUMS}
    sums = dict(line.split("  ")[::-1] for line in (run / CHECKSUMS).read_text().splitlines())
    assert sums == {name: hashlib.sha256((run / name).read_bytes()).hexdigest() for name in steps}


def test_what_a_generator_draws_is_carried_through_the_slab_below_it(folder: Path, run: Path, tmp_path: Path):
    drawn = Generator.open(file=run / "quantile-0m.onnx", device="cpu").sample(20_000, step_seed(1, "draw", 0))
    np.testing.assert_array_equal(read_muons(run / "drawn-0m.h5").kinetic_energy, drawn.kinetic_energy)
    seed = step_seed(1, "transport", 0)
    transport_file(
        run / "drawn-0m.h5", tmp_path / "lower.h5", 1.0, seed=seed, muons_per_part=8000, folder=tmp_path, progress=False
    )
    expected, found = read_sample(tmp_path / "lower.h5"), read_sample(run / "muons-1m.h5")
    np.testing.assert_array_equal(found.muons.kinetic_energy, expected.muons.kinetic_energy)
    assert found.provenance == expected.provenance


def test_every_muon_file_is_sound_and_says_where_its_muons_come_from(folder: Path, run: Path):
    sea = read_sample(folder / "sea.h5")
    for name, depth in (("drawn-0m.h5", 0.0), ("muons-1m.h5", 1.0)):
        report = check_file(run / name)
        assert report.defects == []
        found = read_sample(run / name)
        assert (found.depth_m, found.medium, found.smoothed) == (depth, sea.medium, sea.smoothed)
        assert found.source == f"{sea.source}, layered through quantile generators"
        assert found.provenance[: len(sea.provenance)] == sea.provenance
        assert f"20000 muons drawn with seed {step_seed(1, 'draw', 0)}" in found.provenance[len(sea.provenance)]
    assert read_sample(run / "drawn-0m.h5").rate == sea.rate


def test_the_models_say_depth_rate_and_seed(run: Path):
    for number, (name, learned) in enumerate({"quantile-0m": "../sea.h5", "quantile-1m": "muons-1m.h5"}.items()):
        model, sample = Generator.open(file=run / f"{name}.onnx", device="cpu").model, read_sample(run / learned)
        assert (model.depth_m, model.rate_hz_per_m2) == (number, pytest.approx(sample.rate, rel=1e-5))
        seed = str(step_seed(1, "fit", number)).encode()
        assert b"training_seed\x12" + bytes([len(seed)]) + seed in (run / f"{name}.onnx").read_bytes()


def test_the_table_has_rate_survivors_energy_and_scores_of_each_depth(folder: Path, run: Path):
    table = rows(planned(folder, held_out=[folder / "held_out.h5"]).layers)
    samples = [read_sample(folder / "sea.h5"), read_sample(run / "muons-1m.h5")]
    for row, sample in zip(table, samples, strict=True):
        energy = sample.muons.kinetic_energy.astype(np.float64)
        assert (row.depth_m, row.rate_hz_per_m2, row.muons) == (sample.depth_m, sample.rate, len(sample))
        assert row.mean_energy_gev == pytest.approx(energy.mean())
        assert row.mean_energy_error_gev == pytest.approx(energy.std() / np.sqrt(len(energy)))
    fraction = len(samples[1]) / 20_000
    assert [row.surviving_fraction for row in table] == [1, fraction]
    assert table[1].surviving_fraction_error == pytest.approx(np.sqrt(fraction * (1 - fraction) / 20_000))
    scores = json.loads((run / "evaluation-0m.json").read_text())
    assert (table[0].delta, table[0].auc) == (scores["cells"]["delta"], scores["classifier"]["auc"])
    assert table[1].auc is None
    read_back = list(csv.DictReader(as_csv(table).splitlines()))
    assert [float(row["rate_hz_per_m2"]) for row in read_back] == [row.rate_hz_per_m2 for row in table]
    assert [row["model"] for row in read_back] == ["quantile-0m.onnx", "quantile-1m.onnx"]
    assert [len(line) for line in as_text(table).splitlines()][1:] == [len(as_text(table).splitlines()[0])] * 2


def test_finished_steps_are_not_repeated(folder: Path, run: Path):
    times, lines = {path: path.stat().st_mtime_ns for path in run.iterdir()}, []
    planned(folder, held_out=[folder / "held_out.h5"]).run(lines.append, progress=False)
    assert [line.split()[1] for line in lines] == ["done"] * 7
    assert {path: path.stat().st_mtime_ns for path in run.iterdir()} == times


@pytest.mark.parametrize("name", ["quantile-0m.pt", "quantile-0m.onnx", "drawn-0m.h5", "muons-1m.h5", "quantile-1m.pt"])
def test_a_run_with_a_damaged_file_is_refused_in_one_line_that_says_what_to_do(folder: Path, run: Path, name: str):
    content = (run / name).read_bytes()
    middle = slice(len(content) // 2, len(content) // 2 + 400)
    damaged = bytearray(content)
    damaged[middle] = bytes(byte ^ 0xFF for byte in content[middle])
    try:
        (run / name).write_bytes(damaged)
        code, out, err = command(folder, "tiny.toml", "sea.h5", "--work", "run", "--held-out", "held_out.h5")
    finally:
        (run / name).write_bytes(content)
    assert (code, out) == (2, "")
    assert err == (
        f"deepmuon-train: run/{name} is damaged or was changed: it is not what the run wrote; remove it, and it is "
        "made again\n"
    )


KILLS: dict[str, dict[str, tuple[str, str, int, str]]] = {
    "quantile": {
        "fit": ("deepmuon_training.generators.quantile.fit", "fit_logit", 1, "*"),
        "export": ("deepmuon_training.export.onnx_export", "compare", 1, "quantile-0m.pt"),
        "draw": ("deepmuon_runtime.muon_file.writer", "MuonWriter.append", 1, "quantile-0m.onnx"),
        "transport": ("time", "sleep", 2, "unfinished-muons-1m.h5/part-00000.h5"),
        "survivors joined": ("deepmuon_runtime.muon_file.writer", "MuonWriter.append", 3, "*/part-00001.h5"),
    },
    "transformer": {
        "fit": ("torch.optim", "AdamW.step", 2, "unfinished-transformer-0m.pt/transformer.pt"),
        "charge fit": ("torch.optim", "AdamW.step", 2, "unfinished-transformer-0m.pt/charge.pt"),
        "export": ("os", "fsync", 1, "transformer-0m.pt"),
    },
}
"""For each kind of step: function, which of its calls kills the process, and the file from which on calls count."""


def killed(folder: Path, work: str, settings: str, module: str, name: str, calls: int, awaited: str) -> None:
    """Run the command until it is killed."""
    command = [sys.executable, "-c", DOOMED, module, name, str(calls), f"{work}/{awaited}"]
    command += ["pipeline", settings, "sea.h5", "--work", work]
    environment = {**os.environ, "OMP_NUM_THREADS": "2"}  # the result is that of one thread all the same
    ended = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert ended.returncode == -signal.SIGKILL, ended.stderr


@pytest.mark.parametrize("architecture", ["quantile", "transformer"])
def test_a_run_killed_in_every_kind_of_step_ends_with_the_bytes_of_an_undisturbed_one(
    folder: Path, run: Path, architecture: str
):
    settings = {"quantile": "tiny.toml", "transformer": "transformer.toml"}[architecture]
    for kill in KILLS[architecture].values():
        killed(folder, f"killed-{architecture}", settings, *kill)
    planned(folder, settings, f"killed-{architecture}").run(lambda line: None, progress=False)
    undisturbed = run
    if architecture == "transformer":
        undisturbed = folder / "transformer"
        planned(folder, settings, "transformer").run(lambda line: None, progress=False)
    found, expected = contents(folder / f"killed-{architecture}"), contents(undisturbed)
    expected.pop("evaluation-0m.json", None)
    assert found.keys() == expected.keys()
    assert [name for name in expected if found[name] != expected[name]] == []


def command(folder: Path, *arguments: str) -> tuple[int, str, str]:
    """Run the installed command: exit code, stdout, stderr."""
    done = subprocess.run([COMMAND, "pipeline", *arguments], cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def test_a_direct_run_carries_on_the_muons_that_it_has_and_draws_none(folder: Path):
    code, out, err = command(folder, "tiny.toml", "sea.h5", "--work", "direct", "--direct", "-q")
    assert (code, err) == (0, "")
    assert [line.split()[-1] for line in out.splitlines()] == ["model", "quantile-0m.onnx", "quantile-1m.onnx"]
    assert "direct = true" in (folder / "direct" / "settings.toml").read_text()
    assert [path.name for path in (folder / "direct").glob("*.h5")] == ["muons-1m.h5"]
    sea, below = read_sample(folder / "sea.h5"), read_sample(folder / "direct" / "muons-1m.h5")
    assert below.source == sea.source
    assert len(below.provenance) == len(sea.provenance) + 1
    (_, lower) = csv.DictReader((folder / "direct" / "layers.csv").read_text().splitlines())
    assert float(lower["surviving_fraction"]) == len(below) / 20_000


def test_a_direct_plan_carries_each_layers_own_muons(folder: Path):
    settings = replace(read_pipeline_settings(folder / "tiny.toml"), direct=True, layers=2)
    pipeline = plan(settings, folder / "sea.h5", folder / "nowhere")
    assert [layer.carried.name for layer in pipeline.layers[:2]] == ["sea.h5", "muons-1m.h5"]
    assert {step.kind for step in pipeline.steps} == {"fit", "export", "transport"}
    assert not (folder / "nowhere").exists()


def test_runs_with_one_stated_time_give_the_same_bytes_in_every_file(folder: Path, tmp_path: Path):
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000"}
    for name in "first", "second":
        (tmp_path / name).mkdir()
        for file in "tiny.toml", "sea.h5":
            (tmp_path / name / file).symlink_to(folder / file)
        words = [COMMAND, "pipeline", "tiny.toml", "sea.h5", "--work", "run", "-q"]
        subprocess.run(words, cwd=tmp_path / name, env=environment, check=True, capture_output=True)
    first, second = (
        {path.name: path.read_bytes() for path in (tmp_path / n / "run").iterdir()} for n in ("first", "second")
    )
    assert first == second
    assert read_attributes(tmp_path / "first/run/drawn-0m.h5")["created"] == "2023-11-14T22:13:20+00:00"


def test_an_unknown_key_ends_the_command_with_exit_code_2_and_one_line(folder: Path):
    (folder / "wrong.toml").write_text("layer_depth = 10\n")
    code, out, err = command(folder, "wrong.toml", "sea.h5", "--work", "wrong")
    assert (code, out) == (2, "")
    assert err == "deepmuon-train: wrong.toml: unknown key 'layer_depth'; the nearest known one is 'layer_m'\n"
    assert not (folder / "wrong").exists()


def run_quietly(pipeline: Pipeline) -> None:
    pipeline.run(lambda line: None, progress=False)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"layers": 2}, r"other settings \(layers = 1 there, layers = 2 here\): give another folder"),
        ({"seed": 2, "direct": True}, r"\(direct = false, seed = 1 there, direct = true, seed = 2 here\)"),
        ({"density": 1.03}, r"\(nothing there, density = 1\.03 here\)"),
    ],
)
def test_the_folder_of_a_run_with_other_settings_is_refused(folder: Path, run: Path, change, complaint):
    before = contents(run)
    settings = replace(read_pipeline_settings(folder / "tiny.toml"), **change)
    with pytest.raises(RefusedError, match=complaint):
        run_quietly(plan(settings, folder / "sea.h5", run))
    assert contents(run) == before


def test_the_folder_of_a_run_of_another_sample_is_refused(folder: Path, run: Path):
    settings = read_pipeline_settings(folder / "tiny.toml")
    with pytest.raises(RefusedError, match="holds the run of another sample"):
        run_quietly(plan(settings, folder / "held_out.h5", run))


def test_a_folder_that_holds_something_else_is_refused_and_left_alone(folder: Path, tmp_path: Path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(RefusedError, match=r"holds no run, but thesis\.tex"):
        run_quietly(planned(folder, work=tmp_path))
    with pytest.raises(RefusedError, match="can't be made or read"):
        run_quietly(planned(folder, work=tmp_path / "thesis.tex"))
    assert [path.read_text() for path in tmp_path.iterdir()] == ["precious"]


def test_a_folder_in_which_another_process_is_at_work_is_refused(folder: Path, run: Path):
    with (run / "settings.toml").open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(RefusedError, match="another process is at work in"):
            run_quietly(planned(folder))


def test_a_sample_that_cannot_be_learned_or_carried_on_is_refused_before_anything_is_written(folder: Path, tmp_path):
    sea = read_sample(folder / "sea.h5")
    settings = read_pipeline_settings(folder / "tiny.toml")
    upward = replace(sea.muons, w=np.where(np.arange(len(sea)) == 5, 0.5, sea.muons.w).astype(np.float32))
    for name, sample, complaint in (
        ("few", replace(sea, muons=sea.muons[:100]), "100 muons are too few"),
        ("upward", replace(sea, muons=upward), "muon number 5 has a direction whose length is not 1"),
        ("rock", replace(sea, depth_m=5.0, medium="G4_CONCRETE"), "muons under 5 m of G4_CONCRETE can't go on in"),
    ):
        write_sample(tmp_path / f"{name}.h5", sample)
        with pytest.raises(RefusedError, match=complaint):
            plan(settings, tmp_path / f"{name}.h5", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_held_out_muons_that_nothing_can_be_compared_with_are_refused(folder: Path, tmp_path: Path):
    deep = tmp_path / "deep.h5"
    write_sample(deep, replace(read_sample(folder / "held_out.h5"), depth_m=5.0))
    held_out = folder / "held_out.h5"
    for files, complaint in (
        ([deep], "has muons at 5 m, and no layer ends there"),
        ([folder / "sea.h5"], "has 20000 muons: at least 100000 are needed to compare"),
        ([held_out, held_out], "both have muons at 0 m"),
    ):
        with pytest.raises(RefusedError, match=complaint):
            planned(folder, held_out=files)


def test_a_slab_that_too_few_muons_cross_ends_the_run(folder: Path, tmp_path: Path):
    settings = replace(read_pipeline_settings(folder / "tiny.toml"), layer_m=60.0, direct=True)
    pipeline = plan(settings, folder / "sea.h5", tmp_path / "run")
    (tmp_path / "run").mkdir()
    pipeline.steps[2].run(progress=False)
    with pytest.raises(FailedError, match=r"fit what came through at 60 m: \d+ muons are too few to learn from"):
        pipeline.steps[3].run(progress=False)


def test_a_run_may_end_in_a_family_of_its_generators(folder: Path):
    (folder / "family.toml").write_text(f"direct = true\nfamily = true\n{TINY}")
    pipeline = planned(folder, "family.toml", "family")
    pipeline.run(lambda line: None, progress=False)
    model = Generator.open(file=folder / "family" / "quantile-family.onnx", depth=0.6, device="cpu").model
    above, below = rows(pipeline.layers)
    assert (model.depth_min_m, model.depth_max_m) == (0, 1)
    assert below.rate_hz_per_m2 < model.rate_hz_per_m2 < above.rate_hz_per_m2
