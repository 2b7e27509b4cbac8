"""What processes take on this machine: time, memory and the size of what they leave."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

__all__ = ["REPOSITORY", "Taken", "cores", "machine", "program", "take"]

REPOSITORY = Path(__file__).parents[2]


class Taken(NamedTuple):
    """What a run took."""

    seconds: float
    """From its start to its end."""

    processor_seconds: float
    """Of all its threads and processes, in the program and in the system."""

    peak_memory: int
    """Bytes, at the highest; of several processes side by side the sum, each with its children."""

    output: int
    """Bytes in its folder."""


def take(commands: Sequence[Sequence[str]], folder: Path) -> Taken:
    """Run commands side by side, in the repository, until all have ended.

    Parameters
    ----------
    commands
        One or more. What they print is thrown away, but not what they say of errors.
    folder
        Where they write.

    Raises
    ------
    SystemExit
        If one of them fails.
    """
    start = time.perf_counter()
    processes = [subprocess.Popen(command, stdout=subprocess.DEVNULL, cwd=REPOSITORY) for command in commands]
    ends = [os.wait4(process.pid, 0) for process in processes]
    seconds = time.perf_counter() - start
    for command, (_, status, _) in zip(commands, ends, strict=True):
        if status:
            sys.exit(f"this failed: {' '.join(command)}")
    processor_seconds = sum(usage.ru_utime + usage.ru_stime for _, _, usage in ends)
    peak_memory = sum(usage.ru_maxrss for _, _, usage in ends) * (1 if sys.platform == "darwin" else 1024)
    return Taken(seconds, processor_seconds, peak_memory, sum(file.stat().st_size for file in folder.iterdir()))


def cores() -> int:
    """Return how many cores the processes may use."""
    return len(os.sched_getaffinity(0))


def machine() -> str:
    """Name the processor."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text(encoding="utf-8").splitlines() if cpuinfo.exists() else []
    processor = next((line.split(":")[1].strip() for line in lines if "model name" in line), platform.processor())
    return f"{processor}, {cores()} cores"


def program(name: str) -> str:
    """Return the path of a command that is installed beside this Python."""
    return shutil.which(name, path=Path(sys.executable).parent) or sys.exit(f"{name} is not installed")
