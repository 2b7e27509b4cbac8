"""A muon file of muons at a depth under a flux, made in parts: a run of minutes that may be interrupted."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.check import check_file
from deepmuon_runtime.muon_file.reader import read_attributes, read_pieces
from deepmuon_runtime.muon_file.writer import MuonWriter
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.ordered_map import ordered_map
from deepmuon_training.progress import progress_bar
from deepmuon_training.sample import Sample, write_sample
from deepmuon_training.underground.integration import plane_integral
from deepmuon_training.underground.place import Place
from deepmuon_training.underground.unweighted import Unweighting
from deepmuon_training.underground.workers import Workers

__all__ = ["Written", "write_depth"]

CHUNKS_PER_PART = 25

PIECE = 1 << 18  # muons that are copied at once


@dataclass(frozen=True)
class Written:
    """What was written.

    Parameters
    ----------
    sample
        What the file says, without its muons.
    repeated
        Share of the muons that are another's repetition, expected from all trials of the integration.
    """

    sample: Sample
    repeated: float


def write_depth(
    path: str | Path,
    at: Place,
    n: int,
    *,
    seed: int,
    folder: Path,
    processes: int | None = None,
    overwrite: bool = False,
    progress: bool = True,
) -> Written:
    """Write n muons of equal weight that cross a horizontal plane at a depth, with energies from 1 MeV to 100 TeV.

    Their rate is integrated first, to 0.1 % where 4,000,000 trials reach that, and with it is found how often a trial
    is accepted. Each part is written as a file of its own when it is done, and parts that are there are not made again:
    however often it was interrupted, and by however many processes, the muons of a seed are the same. Fewer muons of a
    seed are the first of more.

    Parameters
    ----------
    path, overwrite
        As for `deepmuon_runtime.MuonWriter`.
    at
        Where.
    n
        How many.
    seed
        0 or more.
    folder
        For the parts; made when the first one is, and left there.
    processes
        That carry muons side by side; by default one per core.
    progress
        Whether to draw a progress bar on stderr.

    Raises
    ------
    RefusedError
        As for `deepmuon_training.underground.integration.plane_integral`, or if the folder has parts of another run or
        a damaged one, or the file can't be written.
    FailedError
        If mulder fails.
    """
    with Workers(at.overburden, processes or os.cpu_count() or 1) as workers:
        rate = plane_integral(at, workers, seed=seed)
        unweighting = Unweighting.of(at, rate)
        sample = Sample(
            Muons.empty(0),
            depth_m=at.depth,
            source=at.flux.origin,
            provenance=(
                f"{n} muons carried back through {at.depth:g} m of {at.overburden.medium} by mulder "
                f"{version('mulder')}, {at.mode}, {at.flux.charges}, seed {seed}, {unweighting.repeated:.2%} repeated",
            ),
            medium=at.overburden.medium,
            rate=rate.value,
            rate_uncertainty=rate.error,
            flux=Path(at.flux.name).stem,
        )
        parts: list[Path] = []
        made = 0
        with progress_bar(n, Path(path).stem, " muons", hidden=not progress) as bar:
            while made < n:
                parts.append(folder / f"part-{len(parts):05d}.h5")
                if not parts[-1].exists():
                    folder.mkdir(exist_ok=True)
                    first = CHUNKS_PER_PART * (len(parts) - 1)
                    muons = Muons.concatenate(list(_part(unweighting, workers, seed, first, n - made)))
                    write_sample(parts[-1], replace(sample, muons=muons))
                number = _checked(parts[-1], sample)
                made += number
                bar.update(min(number, n - bar.n))
    left = n
    with MuonWriter(path, sample.attributes, overwrite) as writer:
        for part in parts:
            for piece in read_pieces(part, PIECE):
                writer.append(piece[:left])
                left -= min(left, len(piece))
    return Written(sample, unweighting.repeated)


def _part(unweighting: Unweighting, workers: Workers, seed: int, first: int, wanted: int) -> Iterator[Muons]:
    """Yield the muons of the chunks of a part, until there are as many as are wanted."""
    chunks = range(first, first + CHUNKS_PER_PART)
    with closing(ordered_map(lambda k: unweighting.chunk(workers, seed, k), chunks, workers.number)) as made:
        for muons in made:
            yield muons
            wanted -= len(muons)
            if wanted <= 0:
                return


def _checked(part: Path, sample: Sample) -> int:
    """Return how many muons a part has, which may have been there before."""
    known = read_attributes(part)
    stated = {name: value for name, value in sample.attributes.items() if known.get(name) != value}
    if stated:
        found = "; ".join(map(str, known.get("provenance", ()))) or "unknown"
        raise RefusedError(
            f"{part} is of another run ({found}): go on with that one's options and seed, or remove {part.parent}"
        )
    if check_file(part).defects:
        raise RefusedError(f"{part} is damaged: remove it, and it is made again")
    return int(known["count"])
