from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path

import numpy as np
import onnx
import pytest
from support.commands import command_line
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator


def bake(folder: Path, *words: object) -> tuple[int, str, str]:
    """Run the command in a folder: exit code, stdout, stderr."""
    done = subprocess.run(command_line("bake", *words), cwd=folder, capture_output=True, text=True)
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
        (["--depth", "1e6"], "no quantile model for a depth of 1e+06 m"),
    ],
)
def test_what_can_not_be_baked_is_refused_in_one_line(tmp_path: Path, family_file: Path, words: list, reason: str):
    model = tmp_path / "model.onnx"
    model.write_bytes(tiny_model())
    names = {"family": family_file, "model": model}
    code, out, err = bake(tmp_path, *(word.format(**names) for word in words), "-o", "out.onnx")
    assert (code, out) == (2, "")
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
