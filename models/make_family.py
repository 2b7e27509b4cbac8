"""Makes the released family again, CRY's muons through 0 to 100 m of water, from CRY's muons to file and card.

    python models/make_family.py --cry cry_sea_level.h5 --surfaces FOLDER --work work

FOLDER holds CRY's muons at sea level in the sets of models/family_plan.py, NAME.h5 each: muon files with their rate, as
deepmuon-train convert makes them of CRY's output. `--plan` lists them. The steps of CRY's tables are taken out by the
maps that `--cry` gives, as for the other models. Samples and generators that lie in the work folder are not made again,
nor what they alone would need, and an interrupted step goes on. Most of the time Geant4 takes.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import click

from deepmuon_runtime.model.baking import bake
from deepmuon_training.data.cry import HELD_OUT_CRY_MUONS, read_cry
from deepmuon_training.data.smoothing import StepSmoother
from deepmuon_training.export.metadata import Training
from deepmuon_training.generators.family import family_of
from deepmuon_training.generators.fit import fit_generator
from deepmuon_training.generators.fitted import FittedGenerator
from deepmuon_training.pipeline.step import Step, run_steps
from deepmuon_training.release.card import card
from deepmuon_training.release.family_card import family_card
from deepmuon_training.release.vectors import muon_vectors
from deepmuon_training.reports.pictures import draw_pictures
from deepmuon_training.sample import Sample, read_sample, write_sample
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.model_evaluation import evaluate_model
from deepmuon_training.transport.slab_file import transport_file
from family_plan import CUT, KNOTS, PLAN, TESTED, Slab, Surface, sample_name
from make import EVALUATED_MUONS, EVALUATIONS, RELEASED, SEED, VECTORS, write_manifest

NAME = "quantile-water"

BAKED = (0, 10, 20, 30, 40, 50)
"""Depths [m] that are released as files of their own, too."""

AS_IT_IS = 10**3.4
"""From this energy [GeV] on muons are as CRY has them: the maps knew five such muons, and go on as a power law.
In a larger set that would pass the energy where Geant4's tables end."""

COMMAND = "python models/make_family.py --cry cry_sea_level.h5 --surfaces FOLDER --work work"

Make = Callable[[Path, bool], None]


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
    for folder in (work / "samples", work / "generators", work / "evaluations"):
        folder.mkdir(parents=True, exist_ok=True)
    steps = [*sample_steps(cry, surfaces, work), *family_steps(work)]
    run_steps(steps, click.echo)
    release(work)


def sample_file(work: Path, name: str) -> Path:
    """Where a sample, or a set at sea level, lies."""
    return work / "samples" / f"{name}.h5"


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


def family_steps(work: Path) -> Iterator[Step]:
    """Yield the steps that fit the knots, make the family, and score it at each depth."""
    generators = [work / "generators" / f"{depth:g}m.pt" for depth in KNOTS]
    for depth, generator in zip(KNOTS, generators, strict=True):
        yield Step("fit", f"at {depth:g} m", generator, _fit(work, depth, generator))
    model = work / f"{NAME}.onnx"
    yield Step("family", f"{len(KNOTS)} generators", work / "notes.txt", _family(generators, model))
    for depth in TESTED:
        evaluation = work / "evaluations" / f"{depth:g}m.json"
        yield Step("score", f"at {depth:g} m", evaluation, _score(work, model, depth, evaluation))


def _fit(work: Path, depth: float, generator: Path) -> Make:
    def make(saved: Path, progress: bool) -> None:
        sample = replace(read_sample(sample_file(work, sample_name("training", depth))), flux="cry")
        fit_generator(sample, "quantile", seed=SEED, checkpoint_folder=saved, progress=progress).save(generator)

    return make


def _family(generators: list[Path], model: Path) -> Make:
    def make(_: Path, progress: bool) -> None:
        family = family_of([FittedGenerator.load(path) for path in generators])
        mismatch = family.export(model, overwrite=True)
        (model.parent / "notes.txt").write_text("\n".join((*family.notes, mismatch.note)) + "\n", encoding="utf-8")

    return make


def _score(work: Path, model: Path, depth: float, evaluation: Path) -> Make:
    def make(_: Path, progress: bool) -> None:
        held_out = read_sample(sample_file(work, sample_name("testing", depth)))
        found = evaluate_model(model, held_out, EVALUATED_MUONS, seed=SEED, depth=depth)
        evaluation.write_text(found.to_json(), encoding="utf-8")

    return make


def release(work: Path) -> None:
    """Put the family, its scores and its card where they are released, and the files of single depths baked from it."""
    released = RELEASED / f"{NAME}.onnx"
    shutil.copyfile(work / released.name, released)
    (EVALUATIONS / NAME).mkdir(exist_ok=True)
    evaluations = {}
    for depth in TESTED:
        text = (work / "evaluations" / f"{depth:g}m.json").read_text(encoding="utf-8")
        (EVALUATIONS / NAME / f"{depth:g}m.json").write_text(text, encoding="utf-8")
        evaluations[float(depth)] = Evaluation.from_json(text)
    knots = [FittedGenerator.load(work / "generators" / f"{depth:g}m.pt").training for depth in KNOTS]
    notes = (work / "notes.txt").read_text(encoding="utf-8").splitlines()
    text = family_card(released, knots, evaluations, command=COMMAND, notes=notes)
    released.with_suffix(".md").write_text(text, encoding="utf-8")
    for metres, knot in zip(KNOTS, knots, strict=True):
        if metres in BAKED:
            _release_baked(released, metres, knot, evaluations[metres], notes)
    write_manifest()


def _release_baked(family: Path, metres: float, knot: Training, evaluation: Evaluation, notes: list[str]) -> None:
    """Bake the model of a knot, and put it where it is released, with its test vectors, scores, pictures and card."""
    name, depth = f"quantile-{metres:g}m", f"{metres:g} m"
    path = RELEASED / f"{name}.onnx"
    path.write_bytes(bake(family.read_bytes(), metres, name=family.name))
    (VECTORS / f"{name}.json").write_text(muon_vectors(path), encoding="utf-8")
    (EVALUATIONS / f"{name}.json").write_text(evaluation.to_json(), encoding="utf-8")
    (EVALUATIONS / name).mkdir(exist_ok=True)
    draw_pictures(evaluation, EVALUATIONS / name, title=f"quantile, {depth}")
    its_own = [f"Baked from {family.name}: the scores are the family's at {depth}, of the same muons."]
    its_own += [note.removeprefix(f"{depth}: ") for note in notes if note.startswith(f"{depth}: ")]
    text = card(path, evaluation, command=COMMAND, provenance=knot.provenance, notes=its_own)
    path.with_suffix(".md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
