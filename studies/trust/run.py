"""Try faults, damaged files and repetitions at random, for as long as you like: docs/trust.md, repeated.

    python studies/trust/run.py --hours 1 --seed 1

The campaigns take turns; each try has random numbers of its own, which follow from the seed and the try's number. What
does not end as docs/trust.md and docs/exit_codes.md say is printed, with its number, and `--only NUMBER` tries that one
again. At the end stands a table of what was tried and what failed; the exit code is 1 if anything did.

Needs Linux, and the packages of the tests: pip install '.[test]'.
"""

from __future__ import annotations

import resource
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import click
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

from support.commands import command_line, wait_for_answers
from support.damage import DAMAGES, cut_out, overwrite, repeat, truncate
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, RefusedError, Shard, check_file, list_models, merge_shards, read_muons
from deepmuon_runtime.files.partial import PARTIAL_SUFFIX
from deepmuon_runtime.model.released import read_released

MUONS = 300_000  # of a run that is disturbed
LONGEST = 600  # s of a command
Random = np.random.Generator


class FaultError(Exception):
    """What should not have happened."""


class Inputs:
    """What the tries start from: a model, and a muon file that it made."""

    def __init__(self, folder: Path) -> None:
        self.model = folder / "model.onnx"
        self.model.write_bytes(tiny_model())
        self.muons = folder / "muons.h5"
        self.generator = Generator.open(file=self.model, device="cpu")
        self.generator.write(self.muons, MUONS, seed=1)
        self.duration = self._duration(folder)

    def commands(self) -> list[tuple[str, list[object]]]:
        """Return the words of each command; each writes `output` but check."""
        make = ["--model", self.model, "-n", MUONS, "--seed", 1, "--threads", 16, "-q", "-o", "output.h5"]
        return [
            ("gen", make),
            ("check", [self.muons]),
            ("csv", [self.muons, "-o", "output.csv"]),
            ("merge", [self.muons, "-q", "-o", "output.h5"]),
            ("plot", [self.muons, "-o", "output.png"]),
        ]

    def _duration(self, folder: Path) -> float:
        """Return how long the longest of them takes, in s."""
        began = time.monotonic()
        subprocess.run(command_line("plot", self.muons, "-o", "muons.png"), cwd=folder, check=True)
        return time.monotonic() - began


def start(command: str, words: list[object], folder: Path, **options: object) -> subprocess.Popen[str]:
    """Start a command in a folder."""
    line = command_line(command, *words)
    return subprocess.Popen(line, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **options)


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Wait for a command, and its child: exit code, stderr."""
    _, err = process.communicate(timeout=LONGEST)
    return process.returncode, err


def see(holds: bool, text: str) -> None:
    """Raise FaultError with the text unless something holds."""
    if not holds:
        raise FaultError(text)


def see_outputs(folder: Path, is_killed: bool = False) -> None:
    """See that what has the name of an output is complete, and that nothing else was left."""
    for path in folder.glob("output*"):
        if path.name.endswith(PARTIAL_SUFFIX):
            see(is_killed, f"{path.name} was left")
        elif path.suffix == ".h5":
            see(check_file(path).defects == [], f"{path.name} has defects")
        else:
            content = path.read_bytes()
            is_whole = content.count(b"\n") == MUONS + 1 if path.suffix == ".csv" else content[-8:-4] == b"IEND"
            see(is_whole, f"{path.name} is not complete")


def see_line(code: int, err: str) -> None:
    """See that a command which did not succeed said why in one line."""
    see("Traceback" not in err, f"a traceback: {err}")
    see(err.count("\n") == (code != 0), f"exit code {code} and {err!r}")


def kill(inputs: Inputs, random: Random, folder: Path) -> None:
    """Send a command a signal, or two, at any moment since it answers them; SIGKILL at any moment at all."""
    command, words = inputs.commands()[random.integers(5)]
    number = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)[random.integers(4)]
    process = start(command, words, folder)
    if number != signal.SIGKILL:
        wait_for_answers(process)
    time.sleep(random.uniform(0, 1.2 * inputs.duration))
    process.send_signal(number)
    if random.random() < 0.3:
        time.sleep(random.uniform(0, 0.1))
        process.send_signal(number)
    code, err = ended(process)
    if number == signal.SIGKILL:
        see(code in (0, -9), f"{command} killed: exit code {code}")
        see("Traceback" not in err, err)
    else:
        see(code in (0, 128 + number), f"{command} at {number.name}: exit code {code}, {err!r}")
        see_line(code, err)
    see_outputs(folder, number == signal.SIGKILL)


def limit(kind: int, low: float, high: float, inputs: Inputs, random: Random, folder: Path) -> None:
    """Let a command have only so much of something: exit code 1 and one line, or all is done."""
    command, words = inputs.commands()[random.integers(5)]
    most = int(np.exp(random.uniform(np.log(low), np.log(high))))
    process = start(command, words, folder, preexec_fn=lambda: resource.setrlimit(kind, (most, most)))
    code, err = ended(process)
    see(code in (0, 1), f"{command} with {most} bytes: exit code {code}, {err!r}")
    see_line(code, err)
    see_outputs(folder)


def model(inputs: Inputs, random: Random, folder: Path) -> None:
    """Run a damaged model: refused, ended by a bad muon, or muons that can be."""
    released = [read_released(one) for one in list_models() if one.depth_m == 0]
    whole = [tiny_model(), tiny_model(8), *released][random.integers(2 + len(released))]
    (folder / "model.onnx").write_bytes(DAMAGES[random.integers(len(DAMAGES))](whole, random))
    words = ["--model", "model.onnx", "-n", 20_000, "--seed", 1, "-q", "-o", "output.h5"]
    code, err = ended(start("gen", words, folder))
    see(code in (0, 1, 2), f"exit code {code}, {err!r}")
    see_line(code, err)
    see_outputs(folder)
    see({path.suffix for path in folder.iterdir()} <= {".onnx", ".h5"}, "something else was written")


def muon_file(inputs: Inputs, random: Random, folder: Path) -> None:
    """Read a damaged muon file by any command: refused, its defects named, or nothing that mattered was hit."""
    damage = (overwrite, truncate, cut_out, repeat)[random.integers(4)]
    whole = folder / "whole.h5"
    inputs.generator.write(whole, 2000, seed=1)
    (folder / "damaged.h5").write_bytes(damage(whole.read_bytes(), random))
    command, ending = (("check", ""), ("csv", "csv"), ("merge", "h5"), ("plot", "png"))[random.integers(4)]
    output = ["-o", f"output.{ending}"] if ending else []
    code, err = ended(start(command, ["damaged.h5", *output], folder))
    see(code in (0, 2, 3), f"{command}: exit code {code}, {err!r}")
    see("Traceback" not in err, err)
    if command == "merge" and code == 0:
        see_outputs(folder)


def shards(inputs: Inputs, random: Random, folder: Path) -> None:
    """Make a run in parts, merge them in any order, and see that it is the run."""
    n, parts, seed = int(random.integers(1, 300_000)), int(random.integers(1, 8)), int(random.integers(2**63))
    paths = [folder / f"{number}.h5" for number in range(1, parts + 1)]
    for number, path in enumerate(paths, 1):
        inputs.generator.write(path, n, seed, shard=Shard(number, parts))
    merge_shards([paths[k] for k in random.permutation(parts)], folder / "output.h5", virtual=bool(random.integers(2)))
    see_same(read_muons(folder / "output.h5"), inputs.generator.sample(n, seed), f"{n} muons in {parts} parts")


def repetition(inputs: Inputs, random: Random, folder: Path) -> None:
    """Make the same muons by any number of threads, from any first one, of any model."""
    models = list_models()
    chosen = models[random.integers(len(models))]
    seed, n = int(random.integers(2**63)), int(random.integers(1, 200_000))
    first = int(random.integers(n))
    one, many = (
        Generator.open(chosen.depth_m, chosen.architecture, device="cpu", threads=threads)
        for threads in (1, int(random.integers(2, 9)))
    )
    see_same(many.sample(n - first, seed, first=first), one.sample(n, seed)[first:], f"{chosen.name}, {n} from {first}")


def see_same(found: object, expected: object, what: str) -> None:
    """See that two sets of muons are the same to the last bit."""
    for name in ("kinetic_energy", "u", "v", "w", "pdg_id"):
        see(np.array_equal(getattr(found, name), getattr(expected, name)), f"{what}: another {name}")


CAMPAIGNS: dict[str, Callable[[Inputs, Random, Path], None]] = {
    "kills": kill,
    "disk: a limit of the file's size": partial(limit, resource.RLIMIT_FSIZE, 100, 1e7),
    "a limit of the memory": partial(limit, resource.RLIMIT_AS, 6e7, 1e9),
    "damaged models": model,
    "damaged muon files": muon_file,
    "shards": shards,
    "determinism": repetition,
}


@click.command()
@click.option("--hours", type=float, default=1.0, show_default=True, help="How long.")
@click.option("--seed", type=int, default=1, show_default=True, help="Of all random numbers.")
@click.option("--only", type=int, help="Only the try of this number.")
def main(hours: float, seed: int, only: int | None) -> None:
    """Try faults, damaged files and repetitions."""
    end = time.monotonic() + 3600 * hours
    tried: Counter[str] = Counter()
    failed: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as made:
        inputs = Inputs(Path(made))
        number = only or 0
        while time.monotonic() < end or number < len(CAMPAIGNS):
            name = list(CAMPAIGNS)[number % len(CAMPAIGNS)]
            tried[name] += 1
            fault = fault_of(CAMPAIGNS[name], inputs, np.random.default_rng([seed, number]))
            if fault:
                failed[name] += 1
                click.echo(f"{name}, seed {seed}, try {number}: {fault}")
            number += 1
            if only is not None:
                break
    click.echo(f"| campaign, seed {seed} | tried | failed |\n|---|--:|--:|")
    for name in CAMPAIGNS:
        click.echo(f"| {name} | {tried[name]} | {failed[name]} |")
    sys.exit(bool(failed))


def fault_of(campaign: Callable[[Inputs, Random, Path], None], inputs: Inputs, random: Random) -> str:
    """Return what went wrong in a try, or nothing."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            campaign(inputs, random, Path(folder))
        except (FaultError, RefusedError, subprocess.TimeoutExpired) as error:
            return f"{type(error).__name__}: {error}"
    return ""


if __name__ == "__main__":
    main()
