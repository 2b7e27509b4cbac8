"""What is compared."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

from studies.shared.processes import REPOSITORY, cores, program

__all__ = ["DEFAULT", "OLD", "SAMPLE", "Commands", "Contestant", "contestants", "deepmuon_gen", "own_job"]

DEFAULT = "deepmuon-gen"
"""The contestant that the others are compared with."""

OLD = "0.1.0"
"""The release that this one is compared with."""

SAMPLE = "sample() to memory"
SAMPLE_CODE = "import sys; from deepmuon_runtime import Generator; Generator.open(0).sample(int(sys.argv[1]), 1)"

Commands = Callable[[int, int, Path], list[list[str]]]
"""From a count, a seed and an empty folder to the commands that are run side by side."""

PIECE = 1 << 17  # muons of one write


@dataclass(frozen=True)
class Contestant:
    """Something that makes muons, or does a part of it.

    Parameters
    ----------
    name
        What the table calls it.
    commands
        What is run.
    share
        How many muons it makes for each of the default's: fewer if it is slow.
    writes
        Whether it leaves its muons in the folder.
    """

    name: str
    commands: Commands
    share: float = 1.0
    writes: bool = True


def contestants(folder: Path, cry: Path | None, ecomug: Path | None, old: Path | None) -> Iterator[Contestant]:
    """Yield all that can be had here.

    Parameters
    ----------
    folder
        For files that they need.
    cry, ecomug
        The user's binaries.
    old
        The folder of an environment in which release 0.1.0 is installed.
    """
    for name, binary in (("CRY", cry), ("EcoMug", ecomug)):
        if binary:
            yield Contestant(name, per_core([str(binary)]), 0.04)
    yield Contestant(DEFAULT, deepmuon_gen("--depth", "0"))
    for which in (("--box", "4", "4", "3"), ("--energy-min", "1")):
        yield Contestant(f"{DEFAULT} {' '.join(which)}", deepmuon_gen("--depth", "0", *which), 0.3)
    yield Contestant(SAMPLE, own_python([sys.executable], SAMPLE_CODE), 0.1, writes=False)
    if old:
        apart = ["env", "-u", "PYTHONPATH"]  # which may lead to this tree
        yield Contestant(OLD, deepmuon_gen("--depth", "0", start=[*apart, str(old / "bin" / DEFAULT)]))
        python = [*apart, str(old / "bin" / "python")]
        yield Contestant(f"{SAMPLE}, {OLD}", own_python(python, SAMPLE_CODE), 0.1, writes=False)
    yield Contestant(f"{DEFAULT}, a tenth as many", deepmuon_gen("--depth", "0"), 0.1)
    yield Contestant("library, no file", own_job("library"), writes=False)
    yield Contestant("NumPy, table of the inverse CDF", per_core(job("inverse-cdf")), 0.1, writes=False)
    yield Contestant("NumPy, accept-reject", per_core(job("accept-reject")), 0.02, writes=False)
    yield Contestant("limit: random numbers alone", own_job("random"), writes=False)
    made = folder / "made"
    made.mkdir()
    (command,) = deepmuon_gen("--depth", "0")(PIECE, 1, made)
    subprocess.run(command, check=True)
    yield Contestant("limit: writing alone", own_job("write", str(made / "muons.h5")))
    yield Contestant("transformer", deepmuon_gen("--depth", "0", "--architecture", "transformer"), 0.1)
    if find_spec("deepmuon_training"):
        model = folder / "paper_size.onnx"
        command = [sys.executable, "-m", "studies.benchmark.paper_size", str(model)]
        subprocess.run(command, check=True, cwd=REPOSITORY)
        yield Contestant("transformer of the paper's size", deepmuon_gen("--model", str(model)), 0.02)
    else:
        print("The transformer of the paper's size is left out: deepmuon-training is not installed.", file=sys.stderr)


def deepmuon_gen(*model: str, name: str = "muons.h5", start: list[str] | None = None) -> Commands:
    """Return the commands of one deepmuon-gen, that of another release if it is started otherwise."""

    def commands(count: int, seed: int, folder: Path) -> list[list[str]]:
        words = [*(start or [program(DEFAULT)]), *model]
        return [[*words, "-n", str(count), "--seed", str(seed), "-q", "-o", str(folder / name)]]

    return commands


def own_python(python: list[str], code: str) -> Commands:
    """Return the commands of one Python that runs code with the count as its argument."""
    return lambda count, seed, folder: [[*python, "-c", code, str(count)]]


def own_job(*names: str) -> Commands:
    """Return the commands of one process that uses all cores itself."""

    def commands(count: int, seed: int, folder: Path) -> list[list[str]]:
        return [[*job(*names), str(count), str(seed), str(folder / "muons")]]

    return commands


def per_core(command: list[str]) -> Commands:
    """Return the commands of one process a core, each ending with COUNT SEED OUT."""

    def commands(count: int, seed: int, folder: Path) -> list[list[str]]:
        parts = [end - start for start, end in pairwise(count * core // cores() for core in range(cores() + 1))]
        return [
            [*command, str(part), str(seed + core), str(folder / f"muons-{core}")]
            for core, part in enumerate(parts)
            if part
        ]

    return commands


def job(*names: str) -> list[str]:
    """Return the command of a job and the file that it takes, if any, without COUNT SEED OUT."""
    return [sys.executable, "-m", "studies.benchmark.job", *names]
