"""The commands and the library where modules and calls are missing that other systems than Linux lack."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from deepmuon_runtime import Generator, check_file, read_muons

LESSER_SYSTEM = Path(__file__).parents[2] / "support" / "lesser_system.py"

each_system = pytest.mark.parametrize("system", ["windows", "macos"])


def on(system: str, folder: Path, program: str, *arguments: object) -> tuple[int, str]:
    """Run a program as another system would: exit code, stderr."""
    words = [sys.executable, LESSER_SYSTEM, system, program, *map(str, arguments)]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=600)
    return done.returncode, done.stderr


def gen(system: str, folder: Path, model: Path, *arguments: object) -> tuple[int, str]:
    words = ("--model", model, "-n", 300_000, "--seed", 1, "-q", "-o", "muons.h5", *arguments)
    return on(system, folder, "gen", *words)


@each_system
def test_the_generator_writes_the_muons_of_linux_and_replaces_a_file_only_when_asked(tmp_path, model_file, system):
    expected = Generator.open(file=model_file).sample(300_000, seed=1)
    for arguments, code in (((), 0), ((), 2), (("--overwrite",), 0)):
        assert gen(system, tmp_path, model_file, *arguments)[0] == code
        assert read_muons(tmp_path / "muons.h5").pdg_id.tolist() == expected.pdg_id.tolist()
        assert check_file(tmp_path / "muons.h5").defects == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["muons.h5", "tiny.onnx"]


@each_system
def test_the_other_commands_do_their_work_and_refuse_damaged_files(tmp_path, model_file, system):
    assert gen(system, tmp_path, model_file) == (0, "")
    (tmp_path / "damaged.h5").write_bytes((tmp_path / "muons.h5").read_bytes()[:1000])
    assert on(system, tmp_path, "check", "muons.h5") == (0, "")
    assert on(system, tmp_path, "merge", "muons.h5", "-o", "merged.h5") == (0, "")
    assert on(system, tmp_path, "convert", "muons.h5", "muons.csv") == (0, "")
    assert on(system, tmp_path, "plot", "muons.h5", "-o", "muons.png") == (0, "")
    for command in (("check", "damaged.h5"), ("convert", "damaged.h5", "damaged.csv")):
        code, err = on(system, tmp_path, *command)
        assert (code, err.count("\n")) == (2, 1)


STOPPED = """
    import signal
    import click
    from deepmuon_cli.process.ending import run

    @click.command()
    def command():
        try:
            signal.raise_signal(signal.SIGINT)
        except BaseException:
            pass
        while True:
            for _ in range(10_000):
                pass

    run(command, "it")
"""


@each_system
def test_ctrl_c_that_a_library_swallows_comes_again(tmp_path, system):
    (tmp_path / "stopped.py").write_text(textwrap.dedent(STOPPED))
    assert on(system, tmp_path, "stopped.py") == (130, "it: stopped by SIGINT\n")


FLUSHED = """
    import fcntl
    from deepmuon_runtime.files.whole import write_whole

    calls = []
    fcntl.fcntl = lambda descriptor, command: calls.append(command)
    write_whole("file", b"all")
    assert set(calls) == {fcntl.F_FULLFSYNC}, calls
"""


def test_macos_is_asked_to_bring_files_through_the_memory_of_the_disk(tmp_path):
    (tmp_path / "flushed.py").write_text(textwrap.dedent(FLUSHED))
    assert on("macos", tmp_path, "flushed.py") == (0, "")
