"""The commands fit, export and evaluate, one after the other as a user runs them."""

from __future__ import annotations

import hashlib
import json
import re
import shlex
import subprocess
import sysconfig
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
import pytest
import torch
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, Muons
from deepmuon_runtime.errors import RefusedError
from deepmuon_training.commands.train import train
from deepmuon_training.learning import charge
from deepmuon_training.sample import Sample, write_sample
from deepmuon_training.scores import evaluate
from studies.pictures.mountain import behind_mountain

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-train"

QUANTILE = """
[azimuth]
steps = 10
"""
TRANSFORMER = """
batch = 512
directions = 4
calibration = 1e5
[schedule]
steps = 4
validate_every = 2
[charge]
steps = 4
validate_every = 2
"""
FIT = "fit sea_level.h5 -o generator.pt --settings quantile.toml"
SLOW_FIT = "fit sea_level.h5 -o generator.pt --architecture transformer -d 16 --settings transformer.toml"


@pytest.fixture(scope="module")
def folder(sample, tmp_path_factory) -> Path:
    """Muon files of 5,000 and 100,000 muons, and quick settings."""
    folder = tmp_path_factory.mktemp("train")
    write_sample(folder / "sea_level.h5", replace(sample, muons=sample.muons[:5000]))
    write_sample(folder / "held_out.h5", sample)
    (folder / "quantile.toml").write_text(QUANTILE)
    (folder / "transformer.toml").write_text(TRANSFORMER)
    return folder


@pytest.fixture
def run(folder, tmp_path, monkeypatch, capsys):
    """Run the command in a folder of its own, with links to the files: what it prints."""
    for path in folder.iterdir():
        (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)

    def run(words: str) -> str:
        train.main(shlex.split(words), prog_name="deepmuon-train", standalone_mode=False)
        return str(capsys.readouterr().out)

    return run


def digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def model(folder, tmp_path_factory) -> Path:
    """A model that the commands made."""
    made = tmp_path_factory.mktemp("made")
    words = ["sea_level.h5", "-o", made / "generator.pt", "--settings", "quantile.toml"]
    subprocess.run([COMMAND, "fit", *words], cwd=folder, check=True, timeout=600)
    subprocess.run([COMMAND, "export", "generator.pt", "-o", "model.onnx"], cwd=made, check=True, timeout=600)
    return made / "model.onnx"


@pytest.mark.parametrize(
    "options",
    ["--settings quantile.toml", "--architecture transformer -d 16 --settings transformer.toml"],
    ids=["quantile", "transformer"],
)
def test_a_muon_file_becomes_a_generator_and_a_model(run, options):
    out = run(f"fit sea_level.h5 -o generator.pt --seed 7 {options}")
    assert "fitted to 5,000 muons" in out
    assert "seed 7" in out
    out = run("export generator.pt -o model.onnx")
    assert "0 m of G4_WATER, 129.03 muons per m2 and s" in out
    assert "ONNX Runtime differs from PyTorch" in out
    generator = Generator.open(file="model.onnx", device="cpu", threads=1)
    assert generator.model.metadata["training_seed"] == "7"
    assert len(generator.sample(1000, seed=1)) == 1000
    assert not list(Path.cwd().glob("*.checkpoint"))


def test_the_same_fit_gives_the_same_bytes(run):
    run(FIT)
    run(FIT.replace("generator.pt", "again.pt"))
    assert digest("generator.pt") == digest("again.pt")


def test_an_unknown_rate_stays_unknown(run, sample):
    write_sample("unknown.h5", replace(sample, muons=sample.muons[:3000], rate=None, rate_uncertainty=None))
    run("fit unknown.h5 -o generator.pt --settings quantile.toml")
    assert "unknown rate" in run("export generator.pt -o model.onnx")
    assert Generator.open(file="model.onnx", device="cpu").model.rate_hz_per_m2 is None


def test_ctrl_c_leaves_a_checkpoint_from_which_the_same_command_goes_on(run, monkeypatch):
    run(SLOW_FIT.replace("generator.pt", "undisturbed.pt"))
    cross_entropy, calls = charge.binary_cross_entropy_with_logits, iter(range(4))

    def stopping(*arguments: torch.Tensor) -> torch.Tensor:
        if next(calls, None) is None:
            raise KeyboardInterrupt
        return cross_entropy(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(charge, "binary_cross_entropy_with_logits", stopping)
        with pytest.raises((KeyboardInterrupt, click.Abort)):
            run(SLOW_FIT)
    kept = {path.name for path in Path("generator.pt.checkpoint").iterdir()}
    assert kept == {"transformer.pt", "charge.pt"}
    assert not Path("generator.pt").exists()
    run(SLOW_FIT)
    assert digest("generator.pt") == digest("undisturbed.pt")
    assert not Path("generator.pt.checkpoint").exists()


def flip(path: str, at: int) -> None:
    """Change 400 bytes of a file."""
    content = np.frombuffer(Path(path).read_bytes(), np.uint8).copy()
    content[at : at + 400] ^= 0x55
    Path(path).write_bytes(content.tobytes())


def test_a_damaged_generator_is_not_exported(run):
    run(FIT)
    size = Path("generator.pt").stat().st_size
    for place in 0, size // 3, size // 2, size - 400:
        flip("generator.pt", place)
        done = subprocess.run([COMMAND, "export", "generator.pt", "-o", "model.onnx"], capture_output=True, text=True)
        assert (done.returncode, done.stdout) == (2, "")
        assert re.fullmatch(
            r"deepmuon-train: generator.pt is (damaged|no generator)[^\n]*: fit it again\n", done.stderr
        )
        assert not Path("model.onnx").exists()
        flip("generator.pt", place)
    run("export generator.pt -o model.onnx")


def test_a_damaged_checkpoint_is_not_gone_on_from(run, monkeypatch):
    def stopping(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("deepmuon_training.generators.transformer.architecture.radius_table", stopping)
        with pytest.raises((KeyboardInterrupt, click.Abort)):
            run(SLOW_FIT)
    flip("generator.pt.checkpoint/charge.pt", 5000)
    done = subprocess.run([COMMAND, *shlex.split(SLOW_FIT)], capture_output=True, text=True)
    assert done.returncode == 2
    assert re.fullmatch(r"deepmuon-train: generator.pt.checkpoint/charge.pt is damaged.*: remove it\n", done.stderr)


def test_muons_with_tied_energies_end_the_command_with_exit_code_2(run, sample):
    energy = np.maximum(np.round(sample.muons.kinetic_energy[:5000], 1), np.float32(0.1))
    write_sample("rounded.h5", replace(sample, muons=replace(sample.muons[:5000], kinetic_energy=energy)))
    done = subprocess.run([COMMAND, "fit", "rounded.h5", "-o", "x.pt"], capture_output=True, text=True)
    assert done.returncode == 2
    assert re.fullmatch(
        r"deepmuon-train: [\d.]+% of the muons \(\d+ of 5,000\) have the same kinetic energy of 0\.\d GeV, .*\n",
        done.stderr,
    )


def test_a_source_that_was_cut_gives_a_model_that_is_cut_there(run, sample):
    cut = sample.muons[:20_000][(sample.muons.kinetic_energy[:20_000] > 1) & (sample.muons.charge[:20_000] < 0)]
    write_sample("cut.h5", replace(sample, muons=cut))
    for command in (
        "fit cut.h5 -o cut.pt --settings quantile.toml --zenith-max 89.5",
        "export cut.pt -o cut.onnx",
    ):
        subprocess.run([COMMAND, *shlex.split(command)], check=True, capture_output=True)
    generator = Generator.open(file="cut.onnx", device="cpu")
    muons = generator.sample(1_000_000, seed=1)
    assert muons.kinetic_energy.min() >= cut.kinetic_energy.min() == np.float32(generator.model.energy_min_gev)
    assert muons.cos_zenith.min() >= np.cos(np.radians(89.5))
    assert (muons.charge == -1).all()
    assert (generator.model.metadata["zenith_max_deg"], generator.model.metadata["only_charge"]) == ("89.5", "-1")
    done = subprocess.run([COMMAND, "fit", "cut.h5", "-o", "x.pt", "--energy-min", "2"], capture_output=True, text=True)
    assert done.returncode == 2
    assert "outside of the 2 GeV that were stated" in done.stderr


def test_the_checkpoint_of_other_muons_is_refused(run, sample, monkeypatch):
    def stopping(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("deepmuon_training.generators.transformer.architecture.radius_table", stopping)
        with pytest.raises((KeyboardInterrupt, click.Abort)):
            run(SLOW_FIT + " --checkpoint kept")
    assert Path("kept").exists()
    write_sample("other.h5", replace(sample, muons=sample.muons[5000:10_000]))
    with pytest.raises(RefusedError, match=r"kept/transformer.pt is a checkpoint of other data"):
        run(SLOW_FIT.replace("sea_level.h5", "other.h5") + " --checkpoint kept")
    run(SLOW_FIT + " --checkpoint kept")
    assert not Path("kept").exists()


def test_a_checkpoint_folder_keeps_what_is_not_a_checkpoint(run):
    Path("kept").mkdir()
    Path("kept/thesis.tex").write_text("...")
    run(FIT + " --checkpoint kept")
    assert [path.name for path in Path("kept").iterdir()] == ["thesis.tex"]


def test_an_azimuth_that_is_not_uniform_is_learned_only_if_wanted(run, sample):
    write_sample("mountain.h5", replace(sample, muons=behind_mountain(sample.muons)))
    with pytest.raises(RefusedError, match=r"the azimuth is not uniform.*\(--azimuth learned\)"):
        run("fit mountain.h5 -o generator.pt --settings quantile.toml")
    assert not Path("generator.pt").exists()
    assert not Path("generator.pt.checkpoint").exists()
    run("fit mountain.h5 -o generator.pt --settings quantile.toml --azimuth learned")
    assert "azimuth is learned" in run("export generator.pt -o model.onnx")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (FIT + " -d 16", "-d goes with --architecture transformer"),
        (FIT + " --architecture transformer --azimuth uniform", "a transformer always learns it"),
        ("fit sea_level.h5 -o generator.pt --architecture transformer -d 100", "should be a multiple of 8"),
        ("fit none.h5 -o generator.pt", "none.h5 can't be read as a muon file"),
        ("fit quantile.toml -o generator.pt", "can't be read as a muon file"),
        ("fit sea_level.h5 -o no/generator.pt", "there is no folder"),
        ("fit sea_level.h5 -o generator.pt --settings none.toml", "none.toml can't be read"),
        ("fit sea_level.h5 -o generator.pt --settings transformer.toml", "unknown key 'batch'"),
        (FIT + " --checkpoint sea_level.h5", "no checkpoint can be kept in sea_level.h5: File exists"),
        ("fit sea_level.h5 -o held_out.h5", "held_out.h5 exists already"),
        ("export none.pt -o model.onnx", "none.pt is no generator that deepmuon-train fit wrote: No such file"),
        ("export sea_level.h5 -o model.onnx", "sea_level.h5 is no generator that deepmuon-train fit wrote"),
        ("export sea_level.h5 -o held_out.h5", "held_out.h5 exists already"),
        ("evaluate none.onnx held_out.h5 -o report.html", "none.onnx"),
        ("evaluate sea_level.h5 held_out.h5 -o report.html", "sea_level.h5"),
        ("evaluate none.onnx held_out.h5 -o sea_level.h5", "sea_level.h5 exists already"),
        ("evaluate none.onnx held_out.h5 -o report.html --json sea_level.h5", "sea_level.h5 exists already"),
        ("evaluate none.onnx held_out.h5 -o report.html --json report.html", "--json needs a file of its own"),
    ],
)
def test_what_cant_be_is_refused_in_one_line_and_nothing_is_written(run, words, complaint):
    before = sorted(path.name for path in Path.cwd().iterdir())
    with pytest.raises((RefusedError, click.ClickException)) as error:
        run(words)
    message = error.value.format_message() if isinstance(error.value, click.ClickException) else str(error.value)
    assert complaint in message
    assert "\n" not in message
    assert sorted(path.name for path in Path.cwd().iterdir()) == before


def test_a_sample_of_the_wrong_energies_is_refused_in_one_line(run, sample):
    energy = sample.muons.kinetic_energy.copy()
    energy[3] = 2e5
    write_sample("tev.h5", replace(sample, muons=replace(sample.muons, kinetic_energy=energy)))
    with pytest.raises(RefusedError, match="muon number 3 has a kinetic energy outside"):
        run("fit tev.h5 -o generator.pt")


def test_the_installed_command_says_why_in_one_line_and_ends_with_2(folder):
    done = subprocess.run(
        [COMMAND, "export", "sea_level.h5", "-o", "held_out.h5"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("deepmuon-train: held_out.h5 exists already")
    assert done.stderr.count("\n") == 1


def test_a_report_is_one_file_with_all_scores_and_pictures(run, model):
    out = run(f"evaluate {model} held_out.h5 -o report.html --json scores.json -n 1e5")
    assert "| KS energy |" in out
    page = Path("report.html").read_text()
    assert page.count("data:image/png;base64,") == 3
    for word in (
        "KS energy",
        digest(str(model)),
        "129.035",
        "held_out.h5",
        "a parametric flux",
        "prefers-color-scheme",
    ):
        assert word in page
    for address in ("http:", "https:", 'src="/', "<script", "<link"):
        assert address not in page
    scores = evaluate.Evaluation.from_json(Path("scores.json").read_text())
    assert scores.generated_muons == scores.held_out_muons == 100_000
    assert json.loads(Path("scores.json").read_text())["seed"] == 1


def test_a_report_is_replaced_only_if_wanted_and_the_same_again(run, model):
    run(f"evaluate {model} held_out.h5 -o report.html -n 1e5")
    first = digest("report.html")
    with pytest.raises(RefusedError, match=r"report.html exists already"):
        run(f"evaluate {model} held_out.h5 -o report.html -n 1e5")
    run(f"evaluate {model} held_out.h5 -o report.html -n 1e5 --overwrite -q")
    assert digest("report.html") == first


def test_a_model_that_others_made_can_be_evaluated(run):
    metadata = {"architecture": "normalising flow <b>", "rate_hz_per_m2": None, "depth_m": "0.0"}
    energies = {"energy_min_gev": "0.001", "energy_max_gev": "100000"}
    Path("other.onnx").write_bytes(tiny_model(metadata=metadata | energies))
    run("evaluate other.onnx held_out.h5 -o report.html -n 1e5")
    page = Path("report.html").read_text()
    assert "normalising flow &lt;b&gt;" in page
    assert "There are no targets for this architecture; beyond noise: KS energy" in page
    assert re.search(r"differs by \d+ sigma", page)
    assert 'class="missed"' not in page


def test_muons_of_another_depth_or_medium_are_not_compared(run, model, sample):
    for place in {"depth_m": 10.0}, {"depth_m": 10.0, "medium": "standard_rock 2.65 g/cm3"}:
        write_sample("other.h5", replace(sample, **place), overwrite=True)
        done = subprocess.run([COMMAND, "evaluate", model, "other.h5", "-o", "x.html"], capture_output=True, text=True)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == (
            f"deepmuon-train: {model} gives muons under 0 m of water, and the held-out ones are from under 10 m "
            f"of {'rock' if 'medium' in place else 'water'}: compare muons of one place\n"
        )
        assert not Path("x.html").exists()


def test_an_uncertainty_that_nobody_stated_is_unknown_and_targets_say_what_can_be_told(run, model, sample):
    write_sample("unsure.h5", replace(sample, rate_uncertainty=None))
    words = [COMMAND, "evaluate", model, "unsure.h5", "-o", "x.html", "-n", "1e5", "--variance-factor", "1.2"]
    out = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert re.search(r"\| rate \(Hz/m2\), statistical errors \| 129 \| 129 ± 0.25 and unknown \|  \|", out)
    assert re.search(r"\| tail above 1 TeV .*\| excess ≤ 0.03 \| ± [\d.]+ \| too few muons to tell \|", out)
    for edges in "0 to 0.05", "0.05 to 0.1", "0.1 to 0.15", "0.15 to 0.2":
        assert f"| cos zenith {edges} |" in out
    page = Path("x.html").read_text()
    assert "vary by 1.2 times the variance" in page
    assert '<td class="text">0.00</td><td class="text">0.05</td>' in page


def test_too_few_held_out_muons_are_refused(run, model):
    with pytest.raises(RefusedError, match="5000 physical held-out muons"):
        run(f"evaluate {model} sea_level.h5 -o report.html")
    assert not Path("report.html").exists()


def test_unphysical_held_out_muons_are_left_out(run, model, sample):
    u = sample.muons.u.copy()
    u[0] = np.nan
    spoiled: Muons = Muons.concatenate([replace(sample.muons, u=u), sample.muons[:1]])
    write_sample("spoiled.h5", Sample(spoiled, 0.0, "a detector"))
    out = run(f"evaluate {model} spoiled.h5 -o report.html -n 1e5")
    assert "of spoiled.h5" in out
    assert "100,000 held-out ones" in Path("report.html").read_text()
