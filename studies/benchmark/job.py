"""One process of the benchmark that is no deepmuon-gen: python -m studies.benchmark.job NAME [FILE] COUNT SEED OUT.

The last three arguments are those of the drivers of other generators; FILE, of muons, is for the job that writes.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime import Generator, read_muons
from deepmuon_runtime.latents.philox import fill_latents
from deepmuon_runtime.muon_file.format import COLUMNS
from deepmuon_runtime.ordered_map import ordered_map
from studies.benchmark import by_hand

__all__ = ["JOBS"]

LATENTS = 5  # of a muon of the default architecture
PIECE = 1 << 17


def library(count: int, seed: int, out: str) -> None:
    """Sample at sea level and let each piece go."""
    for _ in Generator.open(0).chunks(count, seed):
        pass


def random_numbers(count: int, seed: int, out: str) -> None:
    """Make the latents of so many muons, on all cores."""

    def piece(first: int) -> None:
        fill_latents(np.empty((min(PIECE, count - first), LATENTS), np.float32), seed, first)

    for _ in ordered_map(piece, range(0, count, PIECE), len(os.sched_getaffinity(0))):
        pass


def write(made: str, count: int, seed: int, out: str) -> None:
    """Write the bytes of so many muons, those of a file again and again, and flush them to the disk."""
    muons = read_muons(made)
    with h5py.File(out, "x") as file:
        columns = {name: file.create_dataset(name, (count,), dtype) for name, (dtype, _) in COLUMNS.items()}
        for first in range(0, count, len(muons)):
            end = min(first + len(muons), count)
            for name, column in columns.items():
                column[first:end] = getattr(muons, name)[: end - first]
    with open(out, "rb") as file:
        os.fsync(file.fileno())


def by(sampler: Callable[[np.random.Generator, int], list[NDArray[Any]]]) -> Callable[[int, int, str], None]:
    """Return a job that samples by hand and lets each piece go."""

    def job(count: int, seed: int, out: str) -> None:
        random = np.random.default_rng(seed)
        for first in range(0, count, by_hand.PIECE):
            sampler(random, min(by_hand.PIECE, count - first))

    return job


JOBS: dict[str, Callable[..., None]] = {
    "library": library,
    "random": random_numbers,
    "write": write,
    "accept-reject": by(by_hand.accept_reject),
    "inverse-cdf": by(by_hand.inverse_cdf),
}
"""By the name that the command line takes."""


if __name__ == "__main__":
    name, *file, count, seed, out = sys.argv[1:]
    JOBS[name](*file, int(count), int(seed), out)
