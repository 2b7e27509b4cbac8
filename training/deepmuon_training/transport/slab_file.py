"""Any number of muons through a slab, from file to file, in parts: a transport of hours that may be interrupted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from numpy.random import SeedSequence

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.check import check_file
from deepmuon_runtime.muon_file.reader import read_attributes, read_muons, verify_muons
from deepmuon_runtime.muon_file.writer import MuonWriter
from deepmuon_training.progress import progress_bar
from deepmuon_training.sample import read_sample, write_sample
from deepmuon_training.transport.material import medium
from deepmuon_training.transport.slab import below_slab, refuse_none, transport

__all__ = ["transport_file"]


def transport_file(
    source: Path,
    target: Path,
    thickness: float,
    *,
    seed: int,
    muons_per_part: int,
    material: str = "G4_WATER",
    density: float | None = None,
    folder: Path,
    progress: bool = True,
) -> None:
    """Carry the muons of a file through a slab and write the survivors to another, in the order of their primaries.

    Each part is written as a file of its own when it is done, and parts that are there are not carried again: however
    often it was interrupted, the survivors are the same. The memory needed does not grow with the number of muons.

    Parameters
    ----------
    source
        Muon file on the upper plane.
    target
        The file to be written; it must not exist.
    thickness, material, density
        As for `deepmuon_training.transport.slab.transport`.
    seed
        Not negative; each part has one of its own, by its number.
    muons_per_part
        Muons carried between two savings; with the seed it decides what becomes of each.
    folder
        An existing folder for the parts.
    progress
        Whether to draw a progress bar on stderr.

    Raises
    ------
    RefusedError
        As for `transport`, or if `source` is damaged or `target` can't be written.
    FailedError
        If Geant4 fails, or nothing survives.
    """
    upper = read_sample(source, 0, 0)
    overburden = medium(material, density)
    started = int(read_attributes(source)["count"])
    verify_muons(source)  # which its parts can't be
    parts = []
    with progress_bar(started, target.stem, " muons", hidden=not progress) as bar:
        for index, first in enumerate(range(0, started, muons_per_part)):
            number = min(muons_per_part, started - first)
            parts.append(folder / f"part-{index:05d}.h5")
            if not parts[-1].exists():
                carried = transport(
                    replace(upper, muons=read_muons(source, first, number)),
                    thickness,
                    seed=_part_seed(seed, index),
                    material=material,
                    density=density,
                    progress=False,
                )
                write_sample(parts[-1], carried.sample)
            elif read_attributes(parts[-1])["count"] and check_file(parts[-1]).defects:
                raise RefusedError(f"{parts[-1]} is damaged: remove it, and it is made again")
            bar.update(number)
    survived = sum(int(read_attributes(part)["count"]) for part in parts)
    refuse_none(survived, started, thickness, overburden)
    how = f"seed {seed}, in parts of {muons_per_part}"
    lower = below_slab(upper, started, survived, thickness, overburden, how)
    with MuonWriter(target, lower.attributes) as writer:
        for part in parts:
            writer.append(read_muons(part))


def _part_seed(seed: int, index: int) -> int:
    """Return the seed of a part, 0 to 2^32 - 1."""
    return int(SeedSequence(seed, spawn_key=(index,)).generate_state(1)[0])
