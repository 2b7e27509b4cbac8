"""What the steps of CRY's tables do under water: raw muons carried by Geant4, beside smoothed ones and generators.

    python -m studies.paper.raw_cry --cry cry_sea_level.h5 --more-cry cry_40M.h5 --samples samples --work work

Of both files of CRY's muons only those are taken that never trained a generator; SAMPLES holds the same ones smoothed
and carried, as testing-10m.h5 to testing-50m.h5 (`models/make.py` leaves them in WORK/samples). What was carried is in
the work folder and is not repeated.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import click
import numpy as np

from deepmuon_runtime import Generator, Muons, list_models
from deepmuon_training.data.cry import HELD_OUT_CRY_MUONS, read_cry
from deepmuon_training.sample import Sample, read_sample, write_sample
from deepmuon_training.transport.slab import transport
from studies.shared.judged import GENERATED, distances
from studies.shared.options import FILE, FOLDER
from studies.shared.report import write
from studies.shared.trained import SEED

DEEP = 30
"""From this depth [m] on, the muons come from the larger run of CRY, of which the first eight million never trained."""

HELD_OUT_OF_MORE = 8_000_000
ARCHITECTURES = ("quantile", "transformer")


@click.command(help=__doc__)
@click.option("--cry", required=True, type=FILE, help="CRY's muons at sea level, of which the last are held out.")
@click.option("--more-cry", required=True, type=FILE, help="Those of the larger run.")
@click.option("--samples", required=True, type=FOLDER, help="Where the smoothed held-out muons lie.")
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Folder for the raw ones.")
def main(cry: Path, more_cry: Path, samples: Path, work: Path) -> None:
    """Carry the raw muons, and compare what is there at each depth."""
    work.mkdir(parents=True, exist_ok=True)
    depths = sorted({round(model.depth_m) for model in list_models()})
    head = ("depth", "rate", "ratio", "energy", "ratio", "smoothed", *ARCHITECTURES)
    rows: list[tuple[str, ...]] = [head]
    numbers = {}
    for depth, raw in carried(cry, more_cry, depths, work):
        smoothed = read_sample(samples / f"testing-{depth}m.h5")
        rate, energy = (raw.rate, smoothed.rate), (mean_energy(raw.muons), mean_energy(smoothed.muons))
        found = {"smoothed": distances(smoothed.muons, raw.muons)}
        for name in ARCHITECTURES:
            found[name] = distances(Generator.open(depth, architecture=name).sample(GENERATED, seed=SEED), raw.muons)
        numbers[depth] = {"rate": rate, "mean_energy": energy, "raw_muons": len(raw), **found}
        pairs = [text for a, b in (rate, energy) for text in (f"{a:.3f}", f"{a / b:.3f}")]
        rows.append((f"{depth} m", *pairs, *(f"{of['delta']:.2%}" for of in found.values())))
    write(Path(__file__), {"generated": GENERATED, "depths": numbers}, rows)


def carried(cry: Path, more_cry: Path, depths: list[int], work: Path) -> Iterator[tuple[int, Sample]]:
    """Return raw held-out muons at each depth but the first, from the layer above or from CRY."""
    for above, depth in pairwise(depths):
        path = work / f"raw-{depth}m.h5"
        if not path.exists():
            if depth == DEEP:
                sample = read_cry(more_cry, slice(HELD_OUT_OF_MORE))
            elif above == 0:
                sample = read_cry(cry, slice(-HELD_OUT_CRY_MUONS, None))
            else:
                sample = read_sample(work / f"raw-{above}m.h5")
            write_sample(path, transport(sample, depth - sample.depth_m, seed=SEED + depth).sample)
        yield depth, read_sample(path)


def mean_energy(muons: Muons) -> float:
    """Return the mean kinetic energy [GeV]."""
    return float(muons.kinetic_energy.mean(dtype=np.float64))


if __name__ == "__main__":
    main()
