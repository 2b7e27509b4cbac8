"""Makes the released families of the flux `measured`, 0 to 5,000 m of water and 0 to 2,500 m of rock, from nothing.

    python models/make_measured.py --work work

What lies in the work folder is not made again, and an interrupted step goes on. On two cores about 4 hours of mulder
for the samples (`--medium` makes one of the families), and then an hour and a half for the fits and scores of 35
generators.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click

from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.fluxes.sea_level import write_sea_level
from deepmuon_training.pipeline.step import Step, run_steps
from deepmuon_training.underground.depth_file import write_depth
from deepmuon_training.underground.overburden import overburden
from deepmuon_training.underground.place import place
from measured_plan import PLAN, Deep, depths
from released_family import Family, Make, family_steps, make_folders, release, sample_file


@click.command(help=__doc__)
@click.option("--work", type=click.Path(path_type=Path), required=True, help="Folder for samples and generators.")
@click.option("--medium", type=click.Choice(list(PLAN)), multiple=True, default=list(PLAN), help="All if left out.")
@click.option("--samples", "only_samples", is_flag=True, help="Make the samples, and no more.")
def main(work: Path, medium: tuple[str, ...], only_samples: bool) -> None:
    """Make samples, generators, families, scores, and what is released."""
    for one in medium:
        own = work / one
        make_folders(own)
        family = Family(
            name=f"measured-{one}",
            flux=MEASURED.name,
            knots=depths(one, between=False),
            tested=depths(one, between=True),
            command="python models/make_measured.py --work work",
        )
        steps = [*sample_steps(own, one), *([] if only_samples else family_steps(own, family))]
        run_steps(steps, click.echo)
        if not only_samples:
            release(own, family)


def sample_steps(work: Path, medium: str) -> Iterator[Step]:
    """Yield the steps that make the samples of a family."""
    for deep in PLAN[medium]:
        path = sample_file(work, deep.name)
        yield Step("source", f"{deep.muons:,} muons at {deep.depth_m:g} m of {medium}", path, _make(path, deep))


def _make(path: Path, deep: Deep) -> Make:
    def make(folder: Path, progress: bool) -> None:
        if deep.depth_m == 0:
            write_sea_level(path, MEASURED, deep.muons, seed=deep.seed)
            return
        at = place(MEASURED, overburden(deep.medium), deep.depth_m)
        write_depth(path, at, deep.muons, seed=deep.seed, folder=folder, progress=progress)

    return make


if __name__ == "__main__":
    main()
