"""Measures each file format on this machine and writes formats.md: ``python -m studies.benchmark.formats``."""

from __future__ import annotations

import platform
import tempfile
from importlib.metadata import version
from pathlib import Path
from statistics import median

import click

from deepmuon_runtime.formats.registry import FORMATS
from studies.benchmark.contestants import deepmuon_gen
from studies.shared.processes import Taken, machine, program, take
from studies.shared.report import table

RESULT = Path(__file__).with_suffix(".md")


@click.command(help=__doc__)
@click.option("-n", "--number", type=float, default=1e7, show_default=True, help="Muons.")
@click.option("--repetitions", type=click.IntRange(1), default=3, show_default=True, help="How often each is run.")
@click.option("--output", type=click.Path(path_type=Path), default=RESULT, help="The table.")
def main(number: float, repetitions: int, output: Path) -> None:
    """Measure in turn, and write the table of medians."""
    count = int(number)
    written: dict[str, list[Taken]] = {name: [] for name in FORMATS}
    read: dict[str, list[Taken]] = {name: [] for name in FORMATS}
    for seed in range(repetitions):
        for name in FORMATS:
            with tempfile.TemporaryDirectory() as folder:
                file = f"muons.{name}"
                written[name].append(
                    take(deepmuon_gen("--depth", "0", name=file)(count, seed, Path(folder)), Path(folder))
                )
                words = [program("deepmuon-convert"), f"{folder}/{file}", f"{folder}/back.h5"]
                read[name].append(take([words], Path(folder)))
    rows = [("", "`deepmuon-gen`", "core-ns/muon", "peak memory", "bytes/muon", "read and written as HDF5")]
    for name, runs in written.items():
        rows.append(
            (
                f"`.{name}`",
                f"{median(run.seconds for run in runs):.2f} s",
                f"{median(run.processor_seconds for run in runs) / count * 1e9:.3g}",
                f"{max(run.peak_memory for run in runs) / 1e6:.0f} MB",
                f"{runs[0].output / count:.1f}",
                f"{median(run.seconds for run in read[name]):.2f} s",
            )
        )
    libraries = ", ".join(f"{library} {version(library)}" for library in ("numpy", "h5py", "uproot"))
    text = (
        f"# {machine()}\n\nPython {platform.python_version()}, {libraries}. {count:,} muons of 0 m, medians of "
        f"{repetitions} runs of each, in turn.\n\n{table(rows)}"
    )
    output.write_text(text, encoding="utf-8")
    click.echo(text)


if __name__ == "__main__":
    main()
