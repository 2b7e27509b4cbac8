"""Makes the released `transformer` models again, from CRY's muons to ONNX files, cards and manifest.

    python models/make.py --cry cry_sea_level.h5 --more-cry cry_40M.h5 --work work

From 30 m on the muons come from a second, larger run of CRY, of which few muons in a hundred get there. Steps whose
result lies in the work folder are not repeated, and an interrupted fit goes on from its checkpoint. (The `quantile`
models are baked of the family that models/make_family.py makes.)
On two cores: 40 minutes to carry the muons through water, 25 to fit each model, and 2 to evaluate it.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import click

from deepmuon_training.data.cry import HELD_OUT_CRY_MUONS, read_cry
from deepmuon_training.data.smoothing import StepSmoother, smoothed
from deepmuon_training.generators.fit import fit_generator
from deepmuon_training.generators.fitted import FittedGenerator, export_fitted
from deepmuon_training.pipeline.step import Step, run_steps
from deepmuon_training.release.card import card, manifest_entry
from deepmuon_training.release.vectors import muon_vectors
from deepmuon_training.reports.pictures import draw_pictures
from deepmuon_training.sample import Sample, read_sample, write_sample
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.model_evaluation import evaluate_model
from deepmuon_training.transport.slab import transport

REPOSITORY = Path(__file__).parents[1]
RELEASED = REPOSITORY / "models" / "deepmuon_models"
EVALUATIONS = REPOSITORY / "docs" / "evaluations"
VECTORS = REPOSITORY / "tests" / "vectors"
ARCHITECTURE = "transformer"
SEED = 1
EVALUATED_MUONS = 20_000_000
DEPTHS = (0, 10, 20, 30, 40, 50)
LAYER = 10
"""Metres of water between two depths."""

DEEP = 30
"""From this depth [m] on, the muons come from the larger run of CRY."""

DEEP_ROWS = {"testing": slice(8_000_000), "training": slice(8_000_000, 24_000_000)}
"""Which muons of the larger run test and train the generators of the deep."""

PARTS = ("training", "testing")

Make = Callable[[Path, bool], None]
"""Makes the result of a step, as `deepmuon_training.pipeline.step.Step` wants it."""


@click.command(help=__doc__)
@click.option("--cry", required=True, type=click.Path(exists=True, path_type=Path), help="CRY's muons at sea level.")
@click.option("--more-cry", type=click.Path(exists=True, path_type=Path), help="More of them, for 30 m and deeper.")
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Folder for samples and checkpoints.")
@click.option("--depth", "depths", multiple=True, type=int, default=DEPTHS, show_default=True)
def main(cry: Path, more_cry: Path | None, work: Path, depths: tuple[int, ...]) -> None:
    """Make each model of each depth, then the manifest."""
    if more_cry is None and max(depths) >= DEEP:
        raise click.UsageError(f"--more-cry is needed from {DEEP} m on")
    for folder in (work / "samples", *(work / model_name(depth) for depth in depths)):
        folder.mkdir(parents=True, exist_ok=True)
    run_steps([*sample_steps(cry, more_cry, work, max(depths)), *model_steps(work, depths)], click.echo)
    for depth in depths:
        release(work, model_name(depth))
    write_manifest()


def model_name(depth: int) -> str:
    """Return the name of the model of a depth [m]."""
    return f"{ARCHITECTURE}-{depth}m"


def depth_of(name: str) -> int:
    """Return the depth [m] that the name of a model says."""
    return int(name.removeprefix(f"{ARCHITECTURE}-").removesuffix("m"))


def sample_file(work: Path, part: str, depth: int, kind: str = "") -> Path:
    """Where a sample lies."""
    return work / "samples" / f"{part}-{depth}m{kind}.h5"


def sample_steps(cry: Path, more_cry: Path | None, work: Path, deepest: int) -> Iterator[Step]:
    """Yield the steps that make the samples, from sea level to the deepest."""
    yield Step("smooth", "CRY", sample_file(work, "testing", 0), lambda *_: make_sea_level(cry, work))
    for depth in range(LAYER, deepest + 1, LAYER):
        for part in PARTS:
            path = sample_file(work, part, depth)
            if depth == DEEP:
                assert more_cry is not None
                yield Step("transport", f"to {depth} m", path, _deep(cry, more_cry, path, part))
            else:
                yield Step("transport", f"to {depth} m", path, _below(work, path, part, depth))


def make_sea_level(cry: Path, work: Path) -> None:
    """Smooth CRY's muons, by maps fitted on the training part; the held-out ones are kept raw as well."""
    training = read_cry(cry, slice(-HELD_OUT_CRY_MUONS))
    testing = read_cry(cry, slice(-HELD_OUT_CRY_MUONS, None))
    smooth = StepSmoother(training.muons)
    write_sample(sample_file(work, "testing", 0, "-raw"), testing, overwrite=True)
    write_sample(sample_file(work, "training", 0), smoothed(training, smooth), overwrite=True)
    write_sample(sample_file(work, "testing", 0), smoothed(testing, smooth))


def _deep(cry: Path, more_cry: Path, path: Path, part: str) -> Make:
    """Carry muons of the larger run to where the deep begins, smoothed by the maps of the other's training part."""

    def make(_: Path, progress: bool) -> None:
        smooth = StepSmoother(read_cry(cry, slice(-HELD_OUT_CRY_MUONS)).muons)
        sea_level = smoothed(read_cry(more_cry, DEEP_ROWS[part]), smooth)
        carried = transport(sea_level, DEEP, seed=transport_seed(part, DEEP), progress=progress)
        write_sample(path, carried.sample)

    return make


def _below(work: Path, path: Path, part: str, depth: int) -> Make:
    """Carry the muons of the layer above through ten metres of water."""

    def make(_: Path, progress: bool) -> None:
        above = read_sample(sample_file(work, part, depth - LAYER))
        write_sample(path, transport(above, LAYER, seed=transport_seed(part, depth), progress=progress).sample)

    return make


def transport_seed(part: str, depth: int) -> int:
    """Return a seed that no other slab has."""
    return depth + PARTS.index(part)


def model_steps(work: Path, depths: tuple[int, ...]) -> Iterator[Step]:
    """Yield the steps that fit, export and score each model."""
    for name in map(model_name, depths):
        folder = work / name
        generator = folder / f"{name}.pt"
        yield Step("fit", name, generator, _fit(work, generator))
        yield Step("export", name, folder / "notes.json", _export(generator, folder / f"{name}.onnx"))
        yield Step("score", name, folder / "evaluation.json", _score(work, generator))


def _fit(work: Path, generator: Path) -> Make:
    def make(saved: Path, progress: bool) -> None:
        sample = read_sample(sample_file(work, "training", depth_of(generator.stem)))
        fit_generator(sample, ARCHITECTURE, seed=SEED, checkpoint_folder=saved, progress=progress).save(generator)

    return make


def _export(generator: Path, model: Path) -> Make:
    def make(_: Path, progress: bool) -> None:
        exported = export_fitted(FittedGenerator.load(generator), model, overwrite=True)
        (generator.parent / "notes.json").write_text(json.dumps(exported.notes))

    return make


def _score(work: Path, generator: Path) -> Make:
    """Compare 20,000,000 muons with the held-out ones."""
    depth = depth_of(generator.stem)
    raw = sample_file(work, "testing", depth, "-raw")

    def make(_: Path, progress: bool) -> None:
        evaluation = evaluate_model(
            generator.with_suffix(".onnx"),
            read_sample(sample_file(work, "testing", depth)),
            EVALUATED_MUONS,
            seed=SEED,
            raw=read_sample(raw) if raw.exists() else None,
            unphysical_before_mapping=FittedGenerator.load(generator).unphysical_before_mapping,
        )
        (generator.parent / "evaluation.json").write_text(evaluation.to_json())

    return make


def release(work: Path, name: str) -> None:
    """Put a model where it is released, with its test vectors, scores, pictures and card."""
    depth, folder, path = depth_of(name), work / name, RELEASED / f"{name}.onnx"
    shutil.copyfile(folder / path.name, path)
    (VECTORS / f"{name}.json").write_text(muon_vectors(path), encoding="utf-8")
    evaluation = Evaluation.from_json((folder / "evaluation.json").read_text())
    (EVALUATIONS / f"{name}.json").write_text(evaluation.to_json())
    pictures = EVALUATIONS / name
    pictures.mkdir(parents=True, exist_ok=True)
    draw_pictures(evaluation, pictures, title=f"{ARCHITECTURE}, {depth} m")
    write_card(path, evaluation, read_sample(sample_file(work, "training", depth), 0, 0), folder / "notes.json")


def write_card(path: Path, evaluation: Evaluation, sample: Sample, notes: Path) -> None:
    """Write the model's card beside its file, and show it."""
    known = json.loads(notes.read_text())
    text = card(path, evaluation, command=command(depth_of(path.stem)), provenance=sample.provenance, notes=known)
    path.with_suffix(".md").write_text(text)
    click.echo(text)


def command(depth: int) -> str:
    """Return the command that makes the model of a depth [m]."""
    more = "--more-cry cry_40M.h5 " if depth >= DEEP else ""
    return f"python models/make.py --cry cry_sea_level.h5 {more}--work work --depth {depth}"


def write_manifest() -> None:
    """List every released file with its hash and metadata; the default is the architecture that measures best."""
    models = [manifest_entry(path) for path in sorted(RELEASED.glob("*.onnx"))]
    models.sort(key=lambda entry: (entry["architecture"], float(entry["depth_m"])))
    manifest = {"manifest_version": 1, "default_architecture": "quantile", "models": models}
    (RELEASED / "manifest.json").write_text(json.dumps(manifest, indent=2) + "\n")


if __name__ == "__main__":
    main()
