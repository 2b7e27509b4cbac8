"""Makes the released family again, CRY's muons through 0 to 100 m of water, from CRY's muons to file and card.

    python models/make_family.py --cry cry_sea_level.h5 --surfaces FOLDER --work work

FOLDER holds CRY's muons at sea level in the sets of models/family_plan.py, NAME.h5 each: muon files with their rate, as
deepmuon-train convert makes them of CRY's output. `--plan` lists them. The steps of CRY's tables are taken out by the
maps that `--cry` gives, as for the other models. Samples and generators that lie in the work folder are not made again,
nor what they alone would need, and an interrupted step goes on.
On two cores: 5 hours of Geant4, half an hour to fit 13 generators, and 2 minutes for each of 46 evaluations.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import click

from deepmuon_training.data.cry import HELD_OUT_CRY_MUONS, read_cry
from deepmuon_training.data.smoothing import StepSmoother
from deepmuon_training.pipeline.step import Step, run_steps
from deepmuon_training.sample import Sample, read_sample, write_sample
from deepmuon_training.transport.slab_file import transport_file
from family_plan import CUT, KNOTS, PLAN, TESTED, Slab, Surface, sample_name
from released_family import Family, Make, family_steps, make_folders, release, sample_file

CRY = Family(
    name="quantile-water",
    flux="cry",
    knots=KNOTS,
    tested=TESTED,
    command="python models/make_family.py --cry cry_sea_level.h5 --surfaces FOLDER --work work",
    baked=(0, 10, 20, 30, 40, 50),
)

AS_IT_IS = 10**3.4
"""From this energy [GeV] on muons are as CRY has them: the maps knew five such muons, and go on as a power law.
In a larger set that would pass the energy where Geant4's tables end."""


@click.command(help=__doc__)
@click.option("--cry", type=click.Path(exists=True, path_type=Path), help="CRY's muons that fit the smoothing.")
@click.option("--surfaces", type=click.Path(exists=True, path_type=Path), help="Folder of the sets at sea level.")
@click.option("--work", type=click.Path(path_type=Path), required=True, help="Folder for samples and generators.")
@click.option("--plan", "only_plan", is_flag=True, help="List the sets at sea level, and do nothing.")
def main(cry: Path | None, surfaces: Path | None, work: Path, only_plan: bool) -> None:
    """Make samples, generators, family, scores, and what is released."""
    if only_plan:
        for step in PLAN.values():
            if isinstance(step, Surface):
                kept = f", E |w| of {CUT * step.cut_m:g} GeV and more" if step.cut_m else ""
                click.echo(f"{step.name}.h5: {step.muons:,} muons of CRY, seeds from {step.seed} on{kept}")
        return
    make_folders(work)
    run_steps([*sample_steps(cry, surfaces, work), *family_steps(work, CRY)], click.echo)
    release(work, CRY)


def sample_steps(cry: Path | None, surfaces: Path | None, work: Path) -> Iterator[Step]:
    """Yield the steps that make the samples which are not there, and what they need."""
    wanted = [sample_name("training", depth) for depth in KNOTS] + [sample_name("testing", depth) for depth in TESTED]
    needed: set[str] = set()
    for name in wanted:
        while name not in needed and not sample_file(work, name).exists():
            needed.add(name)
            step = PLAN[name]
            name = step.above if isinstance(step, Slab) else name
    for name, step in PLAN.items():
        if name not in needed:
            continue
        path = sample_file(work, name)
        if isinstance(step, Slab):
            yield Step("transport", f"{step.above} to {step.depth_m:g} m", path, _carry(work, step))
        elif cry is None or surfaces is None:
            raise click.UsageError(f"{path} is not there: give --cry and --surfaces, and it is made of {name}.h5")
        else:
            yield Step("smooth", name, path, _smooth(cry, surfaces / path.name, path, step))


def _smooth(cry: Path, raw: Path, path: Path, surface: Surface) -> Make:
    def make(_: Path, progress: bool) -> None:
        smooth = StepSmoother(read_cry(cry, slice(-HELD_OUT_CRY_MUONS)).muons)
        write_sample(path, smoothed_and_cut(read_sample(raw), smooth, CUT * surface.cut_m))

    return make


def smoothed_and_cut(sample: Sample, smooth: StepSmoother, least: float) -> Sample:
    """Take the steps of CRY's tables out of a sample, and leave out muons with E |w| below the least [GeV]."""
    muons = smooth(sample.muons)
    kept = sample.muons.kinetic_energy >= AS_IT_IS
    for column in ("kinetic_energy", "u", "v", "w"):
        getattr(muons, column)[kept] = getattr(sample.muons, column)[kept]
    enough = (muons.kinetic_energy >= 1e-3) & (muons.kinetic_energy * muons.cos_zenith >= least)
    share = float(enough.mean())
    return sample.then(
        f"steps of CRY's tables taken out below {AS_IT_IS:.0f} GeV; E |w| of {least:g} GeV and more kept: "
        f"{int(enough.sum())} remain",
        muons=muons[enough],
        rate=None if sample.rate is None else sample.rate * share,
        rate_uncertainty=None if sample.rate_uncertainty is None else sample.rate_uncertainty * share**0.5,
        smoothed=True,
        flux="cry",
    )


def _carry(work: Path, slab: Slab) -> Make:
    def make(folder: Path, progress: bool) -> None:
        transport_file(
            sample_file(work, slab.above),
            sample_file(work, slab.name),
            slab.thickness,
            seed=slab.seed,
            muons_per_part=slab.muons_per_part,
            folder=folder,
            progress=progress,
        )

    return make


if __name__ == "__main__":
    main()
