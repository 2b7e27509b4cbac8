"""No command replaces what it reads, under whatever name, and asked to overwrite as it may be."""

from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path

import pytest

SCRIPTS = Path(sysconfig.get_path("scripts"))

COMMANDS = {
    "gen": "deepmuon-gen --model {} -n 10",
    "csv": "deepmuon-csv {}",
    "plot": "deepmuon-plot other {}",
    "convert": "deepmuon-train convert {} --format csv",
    "convert root": "deepmuon-train convert {}.root:tree --format root",
    "transport": "deepmuon-train transport {} --thickness 1",
    "fit": "deepmuon-train fit {}",
    "fit with settings": "deepmuon-train fit other --settings {}",
    "export": "deepmuon-train export {}",
    "evaluate model": "deepmuon-train evaluate {} other",
    "evaluate held-out": "deepmuon-train evaluate other {}",
    "evaluate to JSON": "deepmuon-train evaluate {} other -o report.html --json",
}


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("output", ["input", "link"])
def test_its_own_input_is_refused_before_anything_is_read(tmp_path: Path, name: str, output: str):
    suffix = ".root" if name == "convert root" else ".png"
    source = tmp_path / f"input{suffix}"
    source.write_text("precious")
    (tmp_path / f"link{suffix}").symlink_to(source)
    command = COMMANDS[name].format("input" if suffix == ".root" else source.name)
    option = "" if command.endswith("--json") else "-o"
    words = f"{command} {option} {output}{suffix} --overwrite".split()
    done = subprocess.run([SCRIPTS / words[0], *words[1:]], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (2, "")
    expected = f"{words[0]}: {output}{suffix} is read here, and would be replaced: give the output another name\n"
    assert done.stderr == expected
    assert source.read_text() == "precious"
    assert len(list(tmp_path.iterdir())) == 2
