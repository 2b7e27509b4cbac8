"""The batch systems' files are run small, with a shell in the place of the batch system."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from deepmuon_runtime import Generator, read_attributes

BATCH = Path(__file__).parents[2] / "examples" / "batch"
MUONS, SHARDS, SEED, DEPTH = 300_001, 3, 1, 10


@pytest.fixture
def small(tmp_path, monkeypatch) -> Path:
    """A folder with the files, changed to a small run of few shards, and the programs on the path."""
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    for file in BATCH.iterdir():
        text = file.read_text()
        for large, few in {r"-n 1e10\b": f"-n {MUONS}", r"\b100\b": str(SHARDS)}.items():
            text = re.sub(large, few, text)
        (tmp_path / file.name).write_text(text)
    return tmp_path


def run(folder: Path, *command: str, **variables: str) -> None:
    subprocess.run(command, cwd=folder, check=True, env={**os.environ, **variables})


def submit_to_slurm(folder: Path) -> None:
    text = (folder / "muons.slurm").read_text()
    options = dict(re.findall(r"^#SBATCH --([\w-]+)=(.*)$", text, re.MULTILINE))
    first, last = map(int, options["array"].split("-"))
    for task in range(first, last + 1):
        variables = {"SLURM_ARRAY_TASK_ID": str(task), "SLURM_CPUS_PER_TASK": options["cpus-per-task"]}
        run(folder, "bash", "muons.slurm", **variables)


def submit_to_condor(folder: Path) -> None:
    lines = [line for line in (folder / "muons.sub").read_text().splitlines() if line and not line.startswith("#")]
    settings = dict(re.split(r"\s*=\s*", line, maxsplit=1) for line in lines[:-1])
    name, command = re.fullmatch(r"queue (\w+) from (.*) \|", lines[-1]).groups()
    for item in subprocess.run(shlex.split(command), capture_output=True, text=True, check=True).stdout.split():
        values = {**settings, name: item}

        def filled(text: str, values: dict[str, str] = values) -> str:
            return re.sub(r"\$\((\w+)\)", lambda match: filled(values[match[1]]), text)

        run(folder, filled(values["executable"]), *shlex.split(filled(values["arguments"])))
        assert (folder / filled(values["transfer_output_files"])).exists()


@pytest.mark.parametrize("submit", [submit_to_slurm, submit_to_condor])
def test_the_jobs_and_the_merge_give_the_single_run(small, submit):
    submit(small)
    assert len(list(small.glob("shard-*.h5"))) == SHARDS
    run(small, "bash", "merge.sh")
    Generator.open(DEPTH).write(small / "single.h5", MUONS, SEED)
    with h5py.File(small / "muons.h5") as merged, h5py.File(small / "single.h5") as single:
        for name, column in single["muons"].items():
            assert np.array_equal(merged["muons"][name][:], column[:])
    found, expected = read_attributes(small / "muons.h5"), read_attributes(small / "single.h5")
    del found["created"], expected["created"], found["command_line"]
    assert found == expected


def test_a_job_of_slurm_that_is_sent_again_leaves_what_is_there(small):
    submit_to_slurm(small)
    before = {path: path.stat().st_ino for path in small.glob("shard-*.h5")}
    next(iter(before)).unlink()
    submit_to_slurm(small)
    after = {path: path.stat().st_ino for path in small.glob("shard-*.h5")}
    assert after.keys() == before.keys()
    assert sum(after[path] == before[path] for path in before) >= SHARDS - 1
