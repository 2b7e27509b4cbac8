"""The campaigns: each is one try, given what all start from, random numbers and an empty folder."""

from __future__ import annotations

import resource
import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from support.commands import wait_for_answers
from support.damage import DAMAGES, cut_out, overwrite, repeat, truncate
from support.tiny_families import tiny_family
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, Shard, list_models, merge_shards, read_muons
from deepmuon_runtime.model.released import read_released
from studies.trust.tries import Inputs, Random, ended, see, see_line, see_outputs, see_same, start

__all__ = ["CAMPAIGNS"]


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
    see_outputs(folder, "was ended by SIG" in err)  # a library that crashes for want of memory leaves what SIGKILL does


def model(inputs: Inputs, random: Random, folder: Path) -> None:
    """Run a damaged model, or bake one: refused, ended by a bad muon, or muons that can be."""
    released = [read_released(one) for one in list_models() if one.depth_m == 0]
    models = [tiny_model(), tiny_model(8), tiny_family(), *released]
    (folder / "model.onnx").write_bytes(
        DAMAGES[random.integers(len(DAMAGES))](models[random.integers(len(models))], random)
    )
    depth = ["--depth", 0 if random.random() < 0.5 else 13.7]  # which a model of one depth does not take
    bake = ["model.onnx", *depth, "-q", "-o", "output.onnx"]
    make = ["--model", "model.onnx", "-n", 20_000, "--seed", 1, "-q", "-o", "output.h5"]
    choices = [("gen", make), ("gen", [*make, *depth]), ("bake", bake)]
    code, err = ended(start(*choices[random.integers(3)], folder))
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
    outputs = {"check": [], "convert": ["output.csv"], "merge": ["-o", "output.h5"], "plot": ["-o", "output.png"]}
    command, output = list(outputs.items())[random.integers(4)]
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
    which = {"architecture": chosen.architecture, "flux": chosen.flux, "medium": chosen.medium}
    one, many = (
        Generator.open(chosen.depth_m, **which, device="cpu", threads=threads)
        for threads in (1, int(random.integers(2, 9)))
    )
    see_same(many.sample(n - first, seed, first=first), one.sample(n, seed)[first:], f"{chosen.name}, {n} from {first}")


CAMPAIGNS: dict[str, Callable[[Inputs, Random, Path], None]] = {
    "kills": kill,
    "disk: a limit of the file's size": partial(limit, resource.RLIMIT_FSIZE, 100, 1e7),
    "a limit of the memory": partial(limit, resource.RLIMIT_AS, 6e7, 1e9),
    "damaged models": model,
    "damaged muon files": muon_file,
    "shards": shards,
    "determinism": repetition,
}
