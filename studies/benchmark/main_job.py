"""Measures the main job on this machine and writes main_job.md: ``python -m studies.benchmark.main_job``."""

from __future__ import annotations

import platform
import statistics
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

from studies.benchmark.contestants import DEFAULT, deepmuon_gen
from studies.shared.processes import REPOSITORY, machine, program, take
from studies.shared.report import table

RESULT = Path(__file__).with_suffix(".md")
REPETITIONS = 5


def main() -> None:
    """Measure, and write the table."""
    rows = [
        ("", "measured", "peak memory"),
        (f"`{DEFAULT} --help`", f"{help_seconds():.2f} s", ""),
        *(main_job(number) for number in ("1e7", "1e8")),
        ("the wheel, models and all", f"{wheel_size() / 1e6:.2f} MB", ""),
    ]
    RESULT.write_text(f"# {machine()}\n\n{circumstances()}\n\n{table(rows)}", encoding="utf-8")


def help_seconds() -> float:
    """Return the median time of ``deepmuon-gen --help``."""
    with tempfile.TemporaryDirectory() as folder:
        command = [program(DEFAULT), "--help"]
        return statistics.median(take([command], Path(folder)).seconds for _ in range(REPETITIONS))


def main_job(number: str) -> tuple[str, str, str]:
    """Return the row of one run of the main job: the median by time of several."""
    runs = []
    for _ in range(REPETITIONS):
        with tempfile.TemporaryDirectory() as folder:
            commands = deepmuon_gen("--depth", "10")(int(float(number)), 1, Path(folder))
            runs.append(take(commands, Path(folder)))
    seconds = statistics.median(run.seconds for run in runs)
    memory = f"{max(run.peak_memory for run in runs) / 1e6:.0f} MB"
    rate = float(number) / seconds
    return f"`{DEFAULT} --depth 10 -n {number}`", f"{seconds:.2f} s, {rate / 1e6:.1f} million muons/s", memory


def wheel_size() -> int:
    """Build the runtime's wheel and return its size in bytes."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", folder, str(REPOSITORY)]
        subprocess.run(command, check=True)
        return next(Path(folder).glob("*.whl")).stat().st_size


def circumstances() -> str:
    """Say with what this was measured, and how."""
    libraries = ", ".join(f"{name} {version(name)}" for name in ("onnxruntime", "numpy", "h5py"))
    return (
        f"Python {platform.python_version()}, {libraries}. Medians of {REPETITIONS} runs, everything included from "
        "pressing return to the file on the disk; the largest peak memory of all."
    )


if __name__ == "__main__":
    main()
