"""Commands with less memory, threads and processes than they want: one line and exit code 1, or the muons."""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.commands import command_line
from support.thorough import TIMES

from deepmuon_runtime import Generator, check_file
from deepmuon_runtime.files.partial import PARTIAL_SUFFIX

pytestmark = pytest.mark.campaign

MEGABYTE = 1 << 20


@pytest.fixture(scope="module")
def muon_file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("muons") / "muons.h5"
    Generator.open(10).write(path, 300_000, seed=1)
    return path


def commands(muon_file: Path) -> list[tuple[str, list[str]]]:
    """Return the words of each command; all write `output` but check."""
    return [
        ("gen", ["--depth", "10", "-n", "300000", "--seed", "1", "--threads", "4", "-q", "-o", "output.h5"]),
        ("check", [str(muon_file)]),
        ("convert", [str(muon_file), "output.csv"]),
        ("merge", [str(muon_file), "-q", "-o", "output.h5"]),
        ("plot", [str(muon_file), "-o", "output.png"]),
    ]


def assert_done_or_one_line(
    folder: Path, command: str, words: list[str], prefix: tuple[str, ...] = (), **options: object
) -> int:
    """Run a command; see that it did its work, or said why not and left nothing; return the exit code."""
    done = subprocess.run(
        [*prefix, *command_line(command, *words)],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=600,
        env={**os.environ, "MPLCONFIGDIR": str(folder)},
        **options,
    )
    if done.returncode == 0:
        assert done.stderr == ""
    else:
        assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
        assert re.match(rf"deepmuon-{command}: |OpenBLAS error: Memory allocation", done.stderr)
    if "was ended by SIG" in done.stderr:  # a library crashed for want of memory: like SIGKILL, that leaves the file
        for path in folder.glob(f"*{PARTIAL_SUFFIX}"):
            path.unlink()
    left = sorted(path.name for path in folder.glob("output*"))
    assert bool(left) == (done.returncode == 0 and command != "check")
    for path in folder.glob("output*.h5"):
        assert check_file(path).defects == []
    for name in left:
        (folder / name).unlink()
    return done.returncode


@pytest.fixture
def anybodys_folder() -> Iterator[Path]:
    """A folder in which every user may write; pytest's are root's alone."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o777)
        yield Path(name)


def memories(few: int) -> Iterator[int]:
    """Yield sizes from what Python alone needs to what a command does, in MB."""
    yield from np.random.default_rng(few).integers(60, 400, few * TIMES).tolist()


@pytest.mark.parametrize("number", range(5), ids=["gen", "check", "convert", "merge", "plot"])
def test_a_limit_of_the_memory_ends_a_command_in_one_line(tmp_path, muon_file, number):
    """4 sizes of each, between 60 and 400 MB, and one in which none can even load its libraries."""
    command, words = commands(muon_file)[number]
    for megabytes in (130, *memories(4)):
        limit = megabytes * MEGABYTE
        assert_done_or_one_line(
            tmp_path,
            command,
            words,
            preexec_fn=lambda limit=limit: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        )


def test_many_threads_in_little_memory_are_fewer(tmp_path):
    """5 sizes: a thread that lacks memory when it starts would end the process, and leave its temporary file."""
    words = ["--depth", "10", "-n", "3000000", "--seed", "1", "--threads", "64", "-q", "-o", "output.h5"]
    for megabytes in (310, 410, *np.random.default_rng(1).integers(260, 700, 3 * TIMES).tolist()):
        limit = megabytes * MEGABYTE
        assert_done_or_one_line(
            tmp_path,
            "gen",
            words,
            preexec_fn=lambda limit=limit: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        )


@pytest.mark.skipif(os.geteuid() != 0 or shutil.which("setpriv") is None, reason="needs root, and setpriv")
def test_where_threads_and_processes_are_refused_a_command_takes_fewer_or_says_so(anybodys_folder, muon_file):
    """1 to 8 of them in all for `deepmuon-gen`, 1 to 4 for the others."""
    nobody = "setpriv --reuid 54321 --clear-groups --inh-caps=-all,+dac_override --ambient-caps=-all,+dac_override"
    codes: dict[str, list[int]] = {}
    for command, words in commands(shutil.copy(muon_file, anybodys_folder / "muons.h5")):
        for most in range(1, 9 if command == "gen" else 5):
            prefix = (*nobody.split(), "prlimit", f"--nproc={most}")
            code = assert_done_or_one_line(anybodys_folder, command, words, prefix)
            codes.setdefault(command, []).append(code)
    assert codes["gen"] == sorted(codes["gen"], reverse=True)  # with more it succeeds
    assert {found[0] for command, found in codes.items() if command != "gen"} == {1}  # no process for the reading
    assert codes["gen"][3] == 0, "four threads suffice, where more are asked for"
    assert all(found[-1] == 0 for found in codes.values())
