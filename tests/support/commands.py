"""The commands in processes of their own: how they are started, when they answer signals, how many of them end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

__all__ = ["answers_signals", "command_line", "endings", "wait_for_answers", "with_models"]

RUN_MANY = Path(__file__).with_name("run_many.py")
SCRIPT = "import sys; sys.argv[0] = 'deepmuon-{0}'; from deepmuon_cli.start import {0}; sys.exit({0}())"


def command_line(command: str, *words: object) -> list[str]:
    """Return what starts a command, as gen, as pip's script does."""
    return [sys.executable, "-c", SCRIPT.format(command), *map(str, words)]


def with_models(folder: Path) -> dict[str, str]:
    """Return variables of a process that finds the released models of a folder, as `tiny_models.release` writes it."""
    others = filter(None, [os.environ.get("PYTHONPATH")])
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *others])}


def answers_signals(process: subprocess.Popen[str]) -> bool:
    """Tell whether the command, and no longer Python, answers signals, or has ended.

    SIGHUP is the last one that it takes over, unless it was ignored from the start, as under nohup.
    """
    if process.poll() is not None:
        return True
    lines = (line.partition(":") for line in Path(f"/proc/{process.pid}/status").read_text().splitlines())
    masks = {name: int(mask, 16) for name, _, mask in lines if name in ("SigCgt", "SigIgn")}
    caught, ignored = ({n for n in signal.Signals if masks[name] >> (n - 1) & 1} for name in ("SigCgt", "SigIgn"))
    return signal.SIGHUP in caught or (signal.SIGHUP in ignored and signal.SIGTERM in caught)


def wait_for_answers(process: subprocess.Popen[str]) -> None:
    """Wait until `answers_signals`."""
    while not answers_signals(process):
        time.sleep(0.0005)


def endings(command: str, lines: list[list[str]]) -> list[int]:
    """Run a command with each line of arguments, and return the exit codes."""
    done = subprocess.run(
        [sys.executable, RUN_MANY, command],
        input="".join(f"{json.dumps(line)}\n" for line in lines),
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # no thread may run when a process forks
        capture_output=True,
        text=True,
        check=True,
    )
    assert "Traceback" not in done.stderr
    return [int(code) for code in done.stdout.split()]
