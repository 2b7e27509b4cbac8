"""Muons as Dask arrays, made on the workers of a cluster: for those who outgrow one machine.

Needs the extra `dask`: ``pip install 'deepmuon-runtime[dask]'``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import dask.array
from dask import delayed

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.generator import Generator
from deepmuon_runtime.latents.philox import checked_seed, new_seed
from deepmuon_runtime.muon_file.format import COLUMNS
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.sampling.numbers import checked_numbers

__all__ = ["CHUNK", "muon_arrays"]

CHUNK = 1 << 20
"""Muons of a chunk, where nothing else is asked for: 18 MB, and a whole number of the model's blocks."""


def muon_arrays(
    n: int,
    seed: int | None = None,
    *,
    depth: float | None = None,
    architecture: str | None = None,
    flux: str | None = None,
    medium: str | None = None,
    file: str | Path | None = None,
    device: str = "auto",
    chunk: int = CHUNK,
) -> dict[str, dask.array.Array]:
    """Return n muons as columns that are made when they are computed, in chunks, wherever Dask runs.

    They are the muons of `Generator.sample(n, seed)`, for any workers and chunks, and also if a worker dies and
    another does its work again. Each worker process opens the model once, and it must be the same file there.

    Parameters
    ----------
    n
        How many, 0 to 2^53.
    seed
        0 to 2^64 - 1; one from the operating system if left out.
    depth, architecture, flux, medium, file, device
        The model, as for `Generator.open`. A `file` must lie under the same path on each worker.
    chunk
        Muons of a chunk.

    Returns
    -------
    For each column of `Muons`, by name, an array [n].

    Raises
    ------
    RefusedError
        If n, the seed or the chunk is out of range, or the model can't be had; also when muons are computed, if a
        worker has another model under that name.
    """
    numbers = checked_numbers(n)
    seed = new_seed() if seed is None else checked_seed(seed)
    if chunk < 1:
        raise RefusedError(f"chunks of {chunk} muons can't be made: 1 or more can")
    file = None if file is None else Path(file).resolve()
    sha256 = Generator.open(depth, architecture, flux=flux, medium=medium, file=file, device=device).model.sha256
    source = _Source(depth, architecture, flux, medium, file, device, sha256)
    pieces = [
        (delayed(_piece, pure=True)(source, seed, first, count), count)
        for first in range(0, max(1, len(numbers)), chunk)
        for count in [min(chunk, len(numbers) - first)]
    ]
    return {
        name: dask.array.concatenate(
            [dask.array.from_delayed(getattr(piece, name), (count,), dtype) for piece, count in pieces]
        )
        for name, (dtype, _) in COLUMNS.items()
    }


@dataclass(frozen=True)
class _Source:
    """How a worker opens the model: what travels instead of the model itself."""

    depth: float | None
    architecture: str | None
    flux: str | None
    medium: str | None
    file: Path | None
    device: str
    sha256: str


def _piece(source: _Source, seed: int, first: int, count: int) -> Muons:
    return _opened(source).sample(count, seed, first=first)


@lru_cache(maxsize=4)
def _opened(source: _Source) -> Generator:
    """Open the model in this process; one thread, since a worker computes several pieces side by side."""
    generator = Generator.open(
        source.depth,
        source.architecture,
        flux=source.flux,
        medium=source.medium,
        file=source.file,
        device=source.device,
        threads=1,
    )
    if generator.model.sha256 != source.sha256:
        raise RefusedError(
            f"{generator.model.name} on this worker has the SHA-256 {generator.model.sha256}, and should have "
            f"{source.sha256}: install the same release, or copy the same file, everywhere"
        )
    return generator
