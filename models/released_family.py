"""How a released family is made of samples at its knots: fits, file, scores, card, and what is baked of it."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

from deepmuon_runtime.model.baking import bake
from deepmuon_training.export.metadata import Training
from deepmuon_training.generators.family import family_of
from deepmuon_training.generators.fit import fit_generator
from deepmuon_training.generators.fitted import FittedGenerator
from deepmuon_training.pipeline.step import Step
from deepmuon_training.release.card import card
from deepmuon_training.release.family_card import family_card
from deepmuon_training.release.vectors import muon_vectors
from deepmuon_training.reports.pictures import draw_pictures
from deepmuon_training.sample import read_sample
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.model_evaluation import evaluate_model
from family_plan import sample_name
from make import EVALUATED_MUONS, EVALUATIONS, RELEASED, SEED, VECTORS, write_manifest

__all__ = ["Family", "Make", "family_steps", "make_folders", "release", "sample_file"]

SURFACES = ("plane", "sphere")

Make = Callable[[Path, bool], None]
"""What a step does: with a folder for what is unfinished, and whether it shows its progress."""


@dataclass(frozen=True)
class Family:
    """A family to be fitted, scored and released.

    Parameters
    ----------
    name
        Of its file, without the suffix.
    flux
        That its samples are of.
    knots, tested
        Depths [m] of its generators, and those at which it is scored.
    command
        That makes it.
    baked
        Depths [m] of knots that are released as files of their own, too.
    """

    name: str
    flux: str
    knots: tuple[float, ...]
    tested: tuple[float, ...]
    command: str
    baked: tuple[float, ...] = ()

    @property
    def evaluated(self) -> list[tuple[float, int]]:
        """Depths [m] and surfaces at which it is scored."""
        return list(product(map(float, self.tested), range(len(SURFACES))))


def make_folders(work: Path) -> None:
    """Make the folders for what is made."""
    for name in ("samples", "generators", "evaluations"):
        (work / name).mkdir(parents=True, exist_ok=True)


def sample_file(work: Path, name: str) -> Path:
    """Where a sample, or a set at sea level, lies."""
    return work / "samples" / f"{name}.h5"


def evaluation_name(depth: float, surface: int) -> str:
    """Return the name of the file with the scores at a depth [m], of muons through a surface."""
    return f"{depth:g}m.json" if surface == 0 else f"{depth:g}m-{SURFACES[surface]}.json"


def family_steps(work: Path, family: Family) -> Iterator[Step]:
    """Yield the steps that fit the knots, make the family, and score it at each depth."""
    generators = [work / "generators" / f"{depth:g}m.pt" for depth in family.knots]
    for depth, generator in zip(family.knots, generators, strict=True):
        yield Step("fit", f"at {depth:g} m", generator, _fit(work, family, depth, generator))
    model = work / f"{family.name}.onnx"
    yield Step("family", f"{len(generators)} generators", work / "notes.txt", _family(generators, model))
    for depth, surface in family.evaluated:
        evaluation = work / "evaluations" / evaluation_name(depth, surface)
        what = f"at {depth:g} m, {SURFACES[surface]}"
        yield Step("score", what, evaluation, _score(work, model, depth, surface, evaluation))


def _fit(work: Path, family: Family, depth: float, generator: Path) -> Make:
    def make(saved: Path, progress: bool) -> None:
        sample = replace(read_sample(sample_file(work, sample_name("training", depth))), flux=family.flux)
        fit_generator(sample, "quantile", seed=SEED, checkpoint_folder=saved, progress=progress).save(generator)

    return make


def _family(generators: list[Path], model: Path) -> Make:
    def make(_: Path, progress: bool) -> None:
        family = family_of([FittedGenerator.load(path) for path in generators])
        mismatch = family.export(model, overwrite=True)
        (model.parent / "notes.txt").write_text("\n".join((*family.notes, mismatch.note)) + "\n", encoding="utf-8")

    return make


def _score(work: Path, model: Path, depth: float, surface: int, evaluation: Path) -> Make:
    def make(_: Path, progress: bool) -> None:
        held_out = read_sample(sample_file(work, sample_name("testing", depth)))
        found = evaluate_model(model, held_out, EVALUATED_MUONS, seed=SEED, depth=depth, surface=surface)
        evaluation.write_text(found.to_json(), encoding="utf-8")

    return make


def release(work: Path, family: Family) -> None:
    """Put a family, its scores and its card where they are released, and the files of single depths baked from it."""
    released = RELEASED / f"{family.name}.onnx"
    shutil.copyfile(work / released.name, released)
    (EVALUATIONS / family.name).mkdir(exist_ok=True)
    evaluations = {}
    for place in family.evaluated:
        text = (work / "evaluations" / evaluation_name(*place)).read_text(encoding="utf-8")
        (EVALUATIONS / family.name / evaluation_name(*place)).write_text(text, encoding="utf-8")
        evaluations[place] = Evaluation.from_json(text)
    knots = [FittedGenerator.load(work / "generators" / f"{depth:g}m.pt").training for depth in family.knots]
    notes = (work / "notes.txt").read_text(encoding="utf-8").splitlines()
    text = family_card(released, knots, evaluations, command=family.command, notes=notes)
    released.with_suffix(".md").write_text(text, encoding="utf-8")
    for depth_m, knot in zip(family.knots, knots, strict=True):
        if depth_m in family.baked:
            _release_baked(released, family, depth_m, knot, evaluations[depth_m, 0], notes)
    write_manifest()


def _release_baked(
    released: Path, family: Family, depth_m: float, knot: Training, evaluation: Evaluation, notes: list[str]
) -> None:
    """Bake the model of a knot, and put it where it is released, with its test vectors, scores, pictures and card."""
    name, depth = f"quantile-{depth_m:g}m", f"{depth_m:g} m"
    path = RELEASED / f"{name}.onnx"
    path.write_bytes(bake(released.read_bytes(), depth_m, name=released.name))
    (VECTORS / f"{name}.json").write_text(muon_vectors(path), encoding="utf-8")
    (EVALUATIONS / f"{name}.json").write_text(evaluation.to_json(), encoding="utf-8")
    (EVALUATIONS / name).mkdir(exist_ok=True)
    draw_pictures(evaluation, EVALUATIONS / name, title=f"quantile, {depth}")
    its_own = [f"Baked from {released.name}: the scores are the family's at {depth}, of the same muons."]
    its_own += [note.removeprefix(f"{depth}: ") for note in notes if note.startswith(f"{depth}: ")]
    text = card(path, evaluation, command=family.command, provenance=knot.provenance, notes=its_own)
    path.with_suffix(".md").write_text(text, encoding="utf-8")
