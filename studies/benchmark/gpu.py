"""Measures what a GPU makes: on the device, in pinned memory, in a file, and with torch in a training loop.

It needs an NVIDIA GPU, onnxruntime-gpu and CuPy (docs/gpu.md), takes 3 minutes, and writes gpu.json and gpu.md beside
itself:

\b
    python -m studies.benchmark.gpu
"""  # noqa: D301 - click looks for the character \b

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click
import numpy as np

from deepmuon_runtime import Box, Cuts, Generator, Plane
from studies.shared.processes import machine
from studies.shared.report import write

ARCHITECTURES = ("quantile", "transformer")
DEPTH = 10
SECONDS = 2.0  # of each measurement, at least
ON_DEVICE, AT_ONCE, IN_FILE = 1 << 26, 1 << 22, 10**8  # muons
CHOSEN: dict[str, dict[str, Any]] = {
    "of 10 GeV and more": {"cuts": Cuts(energy_min=10)},
    "up to 60 degrees": {"cuts": Cuts(zenith_max=60)},
    "on a plane": {"target": Plane(4, 4)},
    "in a box, of a family": {"target": Box(4, 4, 3)},
}


@click.command(help=__doc__)
def main() -> None:
    """Measure and write."""
    if find_spec("cupy") is None:
        raise click.ClickException("CuPy is not installed: docs/gpu.md says how it is")
    rates: dict[str, dict[str, float]] = {}
    for architecture in ARCHITECTURES:
        generator = Generator.open(DEPTH, architecture, device="cuda")
        rates[architecture] = {
            "on the device": rate(on_device(generator), ON_DEVICE),
            **{
                f"on the device, {name}": rate(on_device(generator, **asked), ON_DEVICE)
                for name, asked in CHOSEN.items()
                if generator.model.is_family or not isinstance(asked.get("target"), Box)
            },
            "on the device, with times": rate(with_times(generator), ON_DEVICE),
            "in pinned memory": rate(lambda g=generator: through(g), ON_DEVICE),
            "in an HDF5 file": file_rate(generator),
        }
        if find_spec("torch") is not None:
            rates[architecture]["in a training loop of torch"] = rate(training_loop(generator), 8 * AT_ONCE)
        click.echo(f"{architecture}: {rates[architecture]}")
    processor = Generator.open(DEPTH, device="cpu")
    rates["quantile"]["in memory, by the processor"] = rate(lambda: processor.sample(ON_DEVICE, 1), ON_DEVICE)
    conditions = {"gpu": gpu(), "processor": machine(), "date": f"{datetime.now(UTC):%d %B %Y}"}
    conditions |= {name: version(name) for name in ("deepmuon-runtime", "onnxruntime-gpu", "cupy-cuda13x")}
    places = list(rates["quantile"])
    rows = [["millions a second", *ARCHITECTURES]]
    rows += [[place, *(shown(rates[one].get(place)) for one in ARCHITECTURES)] for place in places]
    write(Path(__file__), {"conditions": conditions, "millions_per_second": rates}, rows)


def rate(make: Callable[[], object], muons: int) -> float:
    """Return millions of muons a second: the GPU is waited for, and the first run does not count."""
    import cupy

    make()
    runs, begun = 0, time.perf_counter()
    while time.perf_counter() - begun < SECONDS:
        make()
        cupy.cuda.Device().synchronize()
        runs += 1
    return runs * muons / (time.perf_counter() - begun) / 1e6


def on_device(generator: Generator, **asked: Any) -> Callable[[], object]:
    """Return muons that stay on the GPU."""
    return lambda: generator.sample(ON_DEVICE, 1, on_device=True, **asked)


def with_times(generator: Generator) -> Callable[[], object]:
    """Return as many, with their times."""
    rate = generator.rate()
    assert rate is not None
    return lambda: generator.sample(live_time=ON_DEVICE / rate.hz, area=1.0, seed=1, on_device=True)


def through(generator: Generator) -> None:
    """Take muons in chunks, as they come from the GPU."""
    for _ in generator.chunks(ON_DEVICE, 1):
        pass


def file_rate(generator: Generator) -> float:
    """Return millions of muons a second of a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "muons.h5"
        begun = time.perf_counter()
        generator.write(path, IN_FILE, 1)
        return IN_FILE / (time.perf_counter() - begun) / 1e6


def training_loop(generator: Generator) -> Callable[[], object]:
    """Return eight steps of a small network that learns an energy from directions."""
    import torch

    network = torch.nn.Sequential(torch.nn.Linear(3, 256), torch.nn.GELU(), torch.nn.Linear(256, 1)).cuda()
    optimizer = torch.optim.Adam(network.parameters())
    done = 0

    def steps() -> None:
        nonlocal done
        for _ in range(8):
            muons = generator.sample(AT_ONCE, 1, first=done, on_device=True)
            columns = muons.kinetic_energy, muons.u, muons.v, muons.w
            energy, *direction = (torch.from_dlpack(column) for column in columns)
            loss = ((network(torch.stack(direction, 1))[:, 0] - energy.log()) ** 2).mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            done += AT_ONCE

    return steps


def gpu() -> str:
    """Name the GPU."""
    import cupy

    name: Any = cupy.cuda.runtime.getDeviceProperties(0)["name"]
    return str(name.decode())


def shown(rate: float | None) -> str:
    """Return a rate in a cell."""
    return "" if rate is None else np.format_float_positional(rate, 3, unique=False, fractional=False, trim="-")


if __name__ == "__main__":
    main()
