"""Compares deepmuon-gen with other ways to muons, and with its limits, on this machine.

All are run in turn, again and again; the table holds medians. CRY and EcoMug take part where you give a program for
each that is called as PROGRAM COUNT SEED OUT; see studies/benchmark/README.md. Let nothing else run meanwhile.

\b
    python -m studies.benchmark.rates
    python -m studies.benchmark.rates -n 1e6 --repetitions 3 --output quick
"""  # noqa: D301 - click looks for the character \b

from __future__ import annotations

import json
import platform
import tempfile
from collections.abc import Iterable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any

import click

from studies.benchmark.contestants import DEFAULT, Commands, Contestant, contestants, deepmuon_gen, own_job
from studies.shared.processes import Taken, machine, take
from studies.shared.report import table

__all__ = ["main"]

PROGRAM = click.Path(exists=True, dir_okay=False, path_type=Path, resolve_path=True)
FILE = click.Path(path_type=Path)
NOT_ON_DISK = 10**8  # more than so many are not written in the runs of --linear

Row = dict[str, Any]


@click.command(help=__doc__)
@click.option("--repetitions", type=click.IntRange(1), default=5, show_default=True, help="How often each is run.")
@click.option("-n", "--number", type=float, default=1e8, show_default=True, help="Muons; the slow make fewer.")
@click.option("--cry", type=PROGRAM, help="A program that makes muons by CRY.")
@click.option("--ecomug", type=PROGRAM, help="A program that makes muons by EcoMug.")
@click.option(
    "--old",
    type=click.Path(exists=True, file_okay=False, path_type=Path, resolve_path=True),
    help="The folder of an environment with release 0.1.0.",
)
@click.option("--linear", is_flag=True, help="Also 0.01, 0.1, 1 and 10 times as many muons, each once.")
@click.option("--output", type=FILE, help="Also write OUTPUT.json, OUTPUT.md and, with Matplotlib, OUTPUT.png.")
def main(
    repetitions: int,
    number: float,
    cry: Path | None,
    ecomug: Path | None,
    old: Path | None,
    linear: bool,
    output: Path | None,
) -> None:
    """Run, print, write."""
    with tempfile.TemporaryDirectory() as folder:
        compared = []
        for contestant in contestants(Path(folder), cry, ecomug, old):
            once(contestant.commands, 1, seed=1)  # one that fails should do so now; others find their files in memory
            compared.append(contestant)
        rows = race(compared, int(number), repetitions)
    report = {
        "machine": machine(),
        "versions": {name: version(name) for name in ("deepmuon-runtime", "onnxruntime", "numpy", "h5py")},
        "python": platform.python_version(),
        "repetitions": repetitions,
        "rows": rows,
        "linear": growth(int(number)) if linear else [],
    }
    text = as_text(report)
    click.echo(text)
    if output is not None:
        output.with_suffix(".json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
        if find_spec("matplotlib"):
            from studies.benchmark.chart import draw

            draw(rows, output.with_suffix(".png"))
            text += f"\n![Muons per second of each]({output.with_suffix('.png').name})\n"
        output.with_suffix(".md").write_text(text, encoding="utf-8")


def race(compared: list[Contestant], number: int, repetitions: int) -> list[Row]:
    """Run all in turn, again and again; then what each took, the default first."""
    runs: list[list[Taken]] = [[] for _ in compared]
    starts: list[list[float]] = [[] for _ in compared]
    counts = [max(1, int(number * contestant.share)) for contestant in compared]
    for seed in range(repetitions):
        for k, contestant in enumerate(compared):
            starts[k].append(once(contestant.commands, 1, seed).seconds)
            runs[k].append(once(contestant.commands, counts[k], seed))
    return [row(*line) for line in zip(compared, counts, runs, starts, strict=True)]


def row(contestant: Contestant, count: int, runs: list[Taken], starts: list[float]) -> Row:
    """Sum up the runs of one."""
    return {
        "name": contestant.name,
        "muons": count,
        "seconds": [run.seconds for run in runs],
        "processor_seconds": [run.processor_seconds for run in runs],
        "muons_per_second": count / median(run.seconds for run in runs),
        "peak_memory": max(run.peak_memory for run in runs),
        "start_seconds": median(starts),
        "bytes_per_muon": runs[0].output / count if contestant.writes else None,
    }


def growth(number: int) -> list[Row]:
    """Run the default for more and more muons, once each."""
    numbers = [int(number * factor) for factor in (0.01, 0.1, 1, 10)]
    kinds = {"to a file": deepmuon_gen("--depth", "0"), "discarded": own_job("library")}
    return [
        {"kind": kind, "muons": n, "seconds": taken.seconds, "peak_memory": taken.peak_memory}
        for kind, commands in kinds.items()
        for n in numbers
        if kind == "discarded" or n <= NOT_ON_DISK
        for taken in [once(commands, n, seed=1)]
    ]


def once(commands: Commands, count: int, seed: int) -> Taken:
    """Run commands in an empty folder."""
    with tempfile.TemporaryDirectory() as folder:
        return take(commands(count, seed, Path(folder)), Path(folder))


def as_text(report: dict[str, Any]) -> str:
    """Return the report as Markdown."""
    libraries = ", ".join(f"{name} {number}" for name, number in report["versions"].items())
    lines = [
        f"# {report['machine']}",
        "",
        f"Python {report['python']}, {libraries}. Medians of {report['repetitions']} runs of each, in turn.",
        "",
        table(race_rows(report["rows"])),
    ]
    if report["linear"]:
        rows = [("", "muons", "time", "time per muon", "peak memory")]
        rows += [
            (
                line["kind"],
                f"{line['muons']:,}",
                f"{line['seconds']:.2f} s",
                f"{line['seconds'] / line['muons'] * 1e9:.1f} ns",
                f"{line['peak_memory'] / 1e6:.0f} MB",
            )
            for line in report["linear"]
        ]
        lines.append(table(rows))
    return "\n".join(lines)


def race_rows(rows: list[Row]) -> Iterable[tuple[str, ...]]:
    """Return the rows of the first table."""
    yield (
        "",
        "muons",
        "million muons/s",
        "deepmuon-gen is faster by",
        "core-ns/muon",
        "peak memory",
        "start",
        "bytes/muon",
    )
    best = next(line["muons_per_second"] for line in rows if line["name"] == DEFAULT)
    for line in rows:
        size = line["bytes_per_muon"]
        yield (
            line["name"],
            f"{line['muons']:,}",
            f"{line['muons_per_second'] / 1e6:.3g}",
            f"{best / line['muons_per_second']:.3g}",
            f"{median(line['processor_seconds']) / line['muons'] * 1e9:.3g}",
            f"{line['peak_memory'] / 1e6:.0f} MB",
            f"{line['start_seconds']:.2f} s",
            "" if size is None else f"{size:.1f}",
        )


if __name__ == "__main__":
    main()
