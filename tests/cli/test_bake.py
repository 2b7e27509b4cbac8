from __future__ import annotations

import hashlib
import os
import subprocess
from pathlib import Path

import numpy as np
import onnx
import pytest
from support.commands import command_line, with_models
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator


def bake(folder: Path, *words: object, released: Path | None = None, **more: str) -> tuple[int, str, str]:
    """Run the command in a folder, maybe with other released models and variables: exit code, stdout, stderr."""
    environment = (dict(os.environ) if released is None else with_models(released)) | more
    done = subprocess.run(command_line("bake", *words), cwd=folder, env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def test_a_family_is_baked_to_a_model_of_one_depth_that_gives_its_muons(tmp_path: Path, family_file: Path):
    code, out, err = bake(tmp_path, family_file, "--depth", "13.7", "-o", "water-13.7m.onnx")
    assert (code, err) == (0, "")
    kilobytes = round((tmp_path / "water-13.7m.onnx").stat().st_size / 1e3)
    assert out == f"water-13.7m.onnx: {family_file} at 13.7 m, {kilobytes} kB\n"
    baked, family = Generator.open(file=tmp_path / "water-13.7m.onnx"), Generator.open(13.7, file=family_file)
    assert np.array_equal(baked.sample(1000, 1).kinetic_energy, family.sample(1000, 1).kinetic_energy)
    assert baked.model.metadata["baked_from"] == hashlib.sha256(family_file.read_bytes()).hexdigest()


def test_two_runs_write_the_same_bytes(tmp_path: Path, family_file: Path):
    for name in ("one.onnx", "two.onnx"):
        assert bake(tmp_path, family_file, "--depth", "0.5", "-q", "-o", name) == (0, "", "")
    assert (tmp_path / "one.onnx").read_bytes() == (tmp_path / "two.onnx").read_bytes()


def test_a_sphere_is_asked_for_by_its_name(tmp_path: Path, family_file: Path):
    assert bake(tmp_path, family_file, "--depth", "10", "--surface", "sphere", "-q", "-o", "sphere.onnx")[0] == 0
    assert Generator.open(file=tmp_path / "sphere.onnx").model.surface == 1


def test_the_released_family_of_a_flux_and_a_medium_is_baked(tmp_path: Path, released_families: Path):
    chosen = ("--flux", "measured", "--medium", "rock", "--depth", "1000")
    code, out, err = bake(tmp_path, *chosen, "-o", "rock.onnx", released=released_families)
    assert (code, err) == (0, "")
    assert out.startswith("rock.onnx: measured-rock.onnx at 1000 m, ")
    baked, family = Generator.open(file=tmp_path / "rock.onnx"), Generator.open(1000, flux="measured", medium="rock")
    assert (baked.model.flux, baked.model.medium, baked.model.depth_m) == ("measured", "rock", 1000)
    assert np.array_equal(baked.sample(1000, 1).kinetic_energy, family.sample(1000, 1).kinetic_energy)


def test_without_a_flux_and_a_medium_it_is_that_of_cry_in_water(tmp_path: Path, released_families: Path):
    code, out, _ = bake(tmp_path, "--depth", "10", "-o", "water.onnx", released=released_families)
    assert (code, out.split(" at ")[0]) == (0, "water.onnx: quantile-water.onnx")


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (
            ["--depth", "10", "--medium", "rock"],
            "no released model of flux cry in rock: there are cry in water, measured in water and measured in rock",
        ),
        (
            ["--depth", "101"],
            "no quantile model of flux cry for a depth of 101 m of water: cry in water has 0 to 100 m; measured in "
            "water has 0 to 5000 m; measured in rock has 0 to 2500 m",
        ),
        (["mine.onnx", "--depth", "10", "--flux", "cry"], "a FAMILY goes without --flux: the file has its own"),
        (["mine.onnx", "--depth", "10", "--medium", "rock"], "a FAMILY goes without --medium: the file has its own"),
    ],
)
def test_a_flux_and_a_medium_that_can_not_be_is_refused(tmp_path: Path, released_families: Path, words, reason):
    answer = bake(tmp_path, *words, "-o", "out.onnx", released=released_families)
    assert answer == (2, "", f"deepmuon-bake: {reason}\n")
    assert not (tmp_path / "out.onnx").exists()


def test_the_shell_completes_flux_medium_and_depth(tmp_path: Path, released_families: Path):
    offered = {"--fl": ["--flux"], "--medium rock --flux ": ["measured"], "--flux measured --depth 5": ["5000"]}
    for words, expected in offered.items():
        line = f"deepmuon-bake {words}"
        asked = {"_DEEPMUON_BAKE_COMPLETE": "bash_complete", "COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
        _, out, _ = bake(tmp_path, released=released_families, **asked)
        assert out.split() == [f"plain,{word}" for word in expected]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["{family}", "--depth", "100.1"], "no depth of 100.1 m in {family}: there are those from 0 to 100 m"),
        (["{family}", "--depth", "nan"], "no depth of nan m in {family}"),
        (["{family}"], "Missing option '--depth'"),
        (["{family}", "--depth", "10", "--surface", "cylinder"], "'cylinder' is not one of 'plane', 'sphere'"),
        (["{model}", "--depth", "10"], "is no family: all its muons are of 10 m"),
        (["missing.onnx", "--depth", "10"], "missing.onnx can't be read: No such file"),
        (["--depth", "10"], "no released family has 10 m: quantile-10m.onnx is a model of this depth alone"),
        (
            ["--depth", "1e6"],
            "no quantile model of flux cry for a depth of 1e+06 m of water: cry in water has 0 and 10",
        ),
    ],
)
def test_what_can_not_be_baked_is_refused_in_one_line(
    tmp_path: Path, family_file: Path, released: Path, words: list, reason: str
):
    model = tmp_path / "model.onnx"
    model.write_bytes(tiny_model())
    names = {"family": family_file, "model": model}
    code, out, err = bake(tmp_path, *(word.format(**names) for word in words), "-o", "out.onnx", released=released)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert reason.format(**names) in err
    assert not (tmp_path / "out.onnx").exists()


def test_a_file_that_exists_is_replaced_only_where_that_is_asked_for(tmp_path: Path, family_file: Path):
    out = tmp_path / "out.onnx"
    out.write_text("mine")
    assert "exists already" in bake(tmp_path, family_file, "--depth", "10", "-o", out)[2]
    assert out.read_text() == "mine"
    assert bake(tmp_path, family_file, "--depth", "10", "--overwrite", "-q", "-o", out) == (0, "", "")
    assert onnx.load(out).graph.node
    before = family_file.read_bytes()
    code, _, err = bake(tmp_path, family_file, "--depth", "10", "--overwrite", "-o", family_file)
    assert (code, family_file.read_bytes()) == (2, before)
    assert "is read here, and would be replaced" in err
