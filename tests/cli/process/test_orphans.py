"""A command that reads muon files works in a child: that one ends with its parent, and publishes nothing after it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path

import pytest

# Waits before it writes, until a file says go; tells its process number before.
PROGRAM = """
    import os, sys, time
    from pathlib import Path
    import click
    from deepmuon_cli.process import isolation
    {before}

    @click.command()
    def command():
        from deepmuon_runtime.files.whole import whole_file

        with whole_file("output", overwrite=True) as file:
            file.write(b"ours")
            Path("child").write_text(str(os.getpid()))
            while not Path("go").exists():
                time.sleep(0.01)

    isolation.run_isolated(command, "it")
"""
WITHOUT_PRCTL = "import ctypes; ctypes.CDLL = lambda name: object()"


def wait_until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 300
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def has_ended(number: int) -> bool:
    try:
        state = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return True
    return state == "Z"


def killed_while_writing(folder: Path, before: str = "") -> tuple[subprocess.Popen[str], int]:
    """Start the program, kill its first process in the middle, and return that and the number of the other one."""
    program = textwrap.dedent(PROGRAM).format(before=before)
    process = subprocess.Popen([sys.executable, "-c", program], cwd=folder, stderr=subprocess.PIPE, text=True)
    told = folder / "child"
    wait_until(lambda: told.exists() and told.read_text())
    process.kill()
    process.wait()  # a killed process goes on for a moment, and its child has a parent until it has ended
    return process, int(told.read_text())


def test_the_child_of_a_killed_command_ends_and_leaves_nothing(tmp_path):
    process, child = killed_while_writing(tmp_path)
    wait_until(lambda: has_ended(child))
    assert process.communicate()[1] == "it: stopped by SIGTERM\n"
    assert [path.name for path in tmp_path.iterdir()] == ["child"]


def test_where_nothing_ends_the_child_it_keeps_a_file_that_was_written_after_the_kill(tmp_path):
    process, child = killed_while_writing(tmp_path, WITHOUT_PRCTL)
    (tmp_path / "output").write_text("theirs")
    (tmp_path / "go").touch()
    wait_until(lambda: has_ended(child))
    assert process.communicate()[1] == (
        "it: the process that should have waited for this one was killed: nothing is written\n"
    )
    assert (tmp_path / "output").read_text() == "theirs"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["child", "go", "output"]


@pytest.mark.parametrize("before", ["", WITHOUT_PRCTL], ids=["Linux", "other systems"])
def test_a_command_whose_parent_waits_writes_its_file(tmp_path, before):
    (tmp_path / "go").touch()
    program = textwrap.dedent(PROGRAM).format(before=before)
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True)
    assert (tmp_path / "output").read_text() == "ours"


def test_a_child_that_shows_life_to_nobody_ends(tmp_path):
    program = """
        import ctypes, os, time
        from pathlib import Path
        import click
        from deepmuon_cli.process import isolation
        ctypes.CDLL = lambda name: object()

        @click.command()
        def command():
            Path("child").write_text(str(os.getpid()))
            while True:
                isolation.show_life()
                time.sleep(0.01)

        isolation.run_isolated(command, "it")
    """
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(program)], cwd=tmp_path, stderr=subprocess.PIPE)
    wait_until(lambda: (tmp_path / "child").exists() and (tmp_path / "child").read_text())
    os.kill(process.pid, signal.SIGKILL)
    wait_until(lambda: has_ended(int((tmp_path / "child").read_text())))
    process.communicate()
