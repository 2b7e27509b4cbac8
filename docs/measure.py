"""Measures the main job on this machine and writes docs/measured.md: ``python docs/measure.py``."""

from __future__ import annotations

import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

REPOSITORY = Path(__file__).parents[1]
COMMAND = shutil.which("deepmuon-gen", path=Path(sys.executable).parent) or sys.exit("deepmuon-gen is not installed")
REPETITIONS = 5


class Run(NamedTuple):
    """What a finished process took."""

    seconds: float
    peak_memory: float
    """Bytes, at the highest."""


def main() -> None:
    """Measure, and write the table."""
    help_seconds = statistics.median(run("--help").seconds for _ in range(REPETITIONS))
    rows = [
        ("`deepmuon-gen --help`", f"{help_seconds:.2f} s", ""),
        *(main_job(number) for number in ("1e7", "1e8")),
        ("the wheel, models and all", f"{wheel_size() / 1e6:.2f} MB", ""),
    ]
    table = ["| | measured | peak memory |", "|---|--:|--:|", *(f"| {' | '.join(row)} |" for row in rows)]
    text = [f"# {machine()}", "", circumstances(), "", *table, ""]
    (REPOSITORY / "docs" / "measured.md").write_text("\n".join(text), encoding="utf-8")


def main_job(number: str) -> tuple[str, str, str]:
    """Return the row of one run of the main job: the median by time of several."""
    with tempfile.TemporaryDirectory() as folder:
        output = str(Path(folder) / "muons.h5")
        arguments = ("--depth", "10", "-n", number, "--seed", "1", "--overwrite", "-o", output)
        runs = sorted(run(*arguments) for _ in range(REPETITIONS))
    middle = runs[REPETITIONS // 2]
    rate = float(number) / middle.seconds
    memory = f"{max(run.peak_memory for run in runs) / 1e6:.0f} MB"
    return f"`deepmuon-gen --depth 10 -n {number}`", f"{middle.seconds:.2f} s, {rate / 1e6:.1f} million muons/s", memory


def run(*arguments: str) -> Run:
    """Run deepmuon-gen and wait for it."""
    start = time.perf_counter()
    process = subprocess.Popen([COMMAND, *arguments], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    if status:
        sys.exit(f"deepmuon-gen {' '.join(arguments)} failed")
    return Run(seconds, usage.ru_maxrss * 1024.0)


def wheel_size() -> int:
    """Build the runtime's wheel and return its size in bytes."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", folder, str(REPOSITORY)], check=True
        )
        return next(Path(folder).glob("*.whl")).stat().st_size


def machine() -> str:
    """Name the processor."""
    cpuinfo = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    processor = next((line.split(":")[1].strip() for line in cpuinfo.splitlines() if "model name" in line), "unknown")
    return f"{processor}, {len(os.sched_getaffinity(0))} cores"


def circumstances() -> str:
    """Say with what this was measured, and how."""
    libraries = ", ".join(f"{name} {version(name)}" for name in ("onnxruntime", "numpy", "h5py"))
    return (
        f"Python {platform.python_version()}, {libraries}. Medians of {REPETITIONS} runs, everything included from "
        "pressing return to the file on the disk; the largest peak memory of all."
    )


if __name__ == "__main__":
    main()
