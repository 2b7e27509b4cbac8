"""Makes the released models again, from CRY's muons to ONNX files, cards and manifest.

    python models/make.py --cry cry_sea_level.h5 --more-cry cry_40M.h5 --work work

From 30 m on the muons come from a second, larger run of CRY, of which few muons in a hundred get there.
Steps whose result lies in the work folder are not repeated, and an interrupted fit goes on from its checkpoint.
On two cores: 40 minutes to carry the muons through water, 4 for each `quantile` and 25 for each `transformer` model,
and 2 to evaluate one.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import click
import torch

from deepmuon_runtime import Generator
from deepmuon_training.data.cry import HELD_OUT_CRY_MUONS, read_cry
from deepmuon_training.data.smoothing import StepSmoother, smoothed
from deepmuon_training.generators.fit import fit_generator
from deepmuon_training.generators.fitted import export_fitted
from deepmuon_training.release.card import card, manifest_entry
from deepmuon_training.release.vectors import muon_vectors
from deepmuon_training.reports.pictures import draw_pictures
from deepmuon_training.sample import Sample, read_sample, write_sample
from deepmuon_training.scores.evaluate import evaluate
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.transport.slab import transport

REPOSITORY = Path(__file__).parents[1]
RELEASED = REPOSITORY / "models" / "deepmuon_models"
EVALUATIONS = REPOSITORY / "docs" / "evaluations"
VECTORS = REPOSITORY / "tests" / "vectors"
SEED = 1
EVALUATED_MUONS = 20_000_000
DEPTHS = (0, 10, 20, 30, 40, 50)
LAYER = 10
"""Metres of water between two depths."""

DEEP = 30
"""From this depth [m] on, the muons come from the larger run of CRY."""

DEEP_ROWS = {"testing": slice(8_000_000), "training": slice(8_000_000, 24_000_000)}
"""Which muons of the larger run test and train the generators of the deep."""


@click.command(help=__doc__)
@click.option("--cry", required=True, type=click.Path(exists=True, path_type=Path), help="CRY's muons at sea level.")
@click.option("--more-cry", type=click.Path(exists=True, path_type=Path), help="More of them, for 30 m and deeper.")
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Folder for samples and checkpoints.")
@click.option("--depth", "depths", multiple=True, type=int, default=DEPTHS, show_default=True)
@click.option("--architecture", "architectures", multiple=True, default=("quantile", "transformer"), show_default=True)
def main(cry: Path, more_cry: Path | None, work: Path, depths: tuple[int, ...], architectures: tuple[str, ...]) -> None:
    """Make each model of each depth, then the manifest."""
    torch.set_num_threads(1)  # other numbers of threads round otherwise
    make_sea_level(cry, work)
    if more_cry and max(depths) >= DEEP:
        make_deep(cry, more_cry, work)
    for depth in depths:
        for part in ("training", "testing"):
            make_sample(work, part, depth)
        for architecture in architectures:
            make_model(work, architecture, depth)
    write_manifest()


def sample_file(work: Path, part: str, depth: int, kind: str = "") -> Path:
    """Where a sample lies."""
    return work / "samples" / f"{part}-{depth}m{kind}.h5"


def make_sea_level(cry: Path, work: Path) -> None:
    """Smooth CRY's muons, by maps fitted on the training part; the held-out ones are kept raw as well."""
    if sample_file(work, "testing", 0).exists():
        return
    (work / "samples").mkdir(parents=True, exist_ok=True)
    training = read_cry(cry, slice(-HELD_OUT_CRY_MUONS))
    testing = read_cry(cry, slice(-HELD_OUT_CRY_MUONS, None))
    smooth = StepSmoother(training.muons)
    write_sample(sample_file(work, "testing", 0, "-raw"), testing)
    for part, sample in (("training", training), ("testing", testing)):
        write_sample(sample_file(work, part, 0), smoothed(sample, smooth))


def make_deep(cry: Path, more_cry: Path, work: Path) -> None:
    """Carry muons of the larger run to where the deep begins, smoothed by the maps of the other's training part."""
    parts = [part for part in DEEP_ROWS if not sample_file(work, part, DEEP).exists()]
    smooth = StepSmoother(read_cry(cry, slice(-HELD_OUT_CRY_MUONS)).muons) if parts else None
    for part in parts:
        sea_level = smoothed(read_cry(more_cry, DEEP_ROWS[part]), smooth)
        write_sample(sample_file(work, part, DEEP), transport(sea_level, DEEP, seed=transport_seed(part, DEEP)).sample)


def make_sample(work: Path, part: str, depth: int) -> None:
    """Carry the muons of the layer above through ten metres of water, as far up as need be."""
    path = sample_file(work, part, depth)
    if path.exists():
        return
    make_sample(work, part, depth - LAYER)
    above = read_sample(sample_file(work, part, depth - LAYER))
    write_sample(path, transport(above, LAYER, seed=transport_seed(part, depth)).sample)


def transport_seed(part: str, depth: int) -> int:
    """Return a seed that no other slab has."""
    return depth + ("training", "testing").index(part)


def make_model(work: Path, architecture: str, depth: int) -> None:
    """Fit and export one model, then evaluate it and write its card."""
    name = f"{architecture}-{depth}m"
    folder = work / name
    folder.mkdir(parents=True, exist_ok=True)
    sample = read_sample(sample_file(work, "training", depth))
    notes = folder / "notes.json"
    if not notes.exists():
        notes.write_text(json.dumps(fit_and_export(architecture, sample, folder / f"{name}.onnx")))
    path = RELEASED / f"{name}.onnx"
    shutil.copyfile(folder / path.name, path)
    (VECTORS / f"{name}.json").write_text(muon_vectors(path), encoding="utf-8")
    evaluate_model(work, path, sample, **json.loads(notes.read_text()))


def fit_and_export(architecture: str, sample: Sample, path: Path) -> dict[str, Any]:
    """Write the ONNX file; return what the fit and the export know of it."""
    generator = fit_generator(sample, architecture, seed=SEED, checkpoint_folder=path.parent)
    exported = export_fitted(generator, path, overwrite=True)
    return {"notes": exported.notes, "unphysical_before_mapping": exported.unphysical_before_mapping}


def evaluate_model(
    work: Path, path: Path, sample: Sample, notes: list[str], unphysical_before_mapping: float | None
) -> None:
    """Compare 20,000,000 muons with the held-out ones, and write scores, pictures and card."""
    generator = Generator.open(file=path, device="cpu")
    model, depth = generator.model, round(sample.depth_m)
    testing = read_sample(sample_file(work, "testing", depth))
    raw = sample_file(work, "testing", depth, "-raw")
    evaluation = evaluate(
        generator.sample(EVALUATED_MUONS, seed=SEED),
        testing.muons,
        seed=SEED,
        muons_per_draw=model.muons_per_draw,
        raw_truth=read_sample(raw).muons if raw.exists() else None,
        generated_rate=(sample.rate, sample.rate_uncertainty),
        truth_rate=(testing.rate, testing.rate_uncertainty),
        energy_range=(model.energy_min_gev, model.energy_max_gev),
        unphysical_before_mapping=unphysical_before_mapping,
    )
    pictures = EVALUATIONS / path.stem
    pictures.mkdir(parents=True, exist_ok=True)
    (EVALUATIONS / f"{path.stem}.json").write_text(evaluation.to_json())
    draw_pictures(evaluation, pictures, title=f"{model.architecture}, {depth} m")
    write_card(path, evaluation, sample, notes)


def write_card(path: Path, evaluation: Evaluation, sample: Sample, notes: list[str]) -> None:
    """Write the model's card beside its file, and show it."""
    depth, architecture = round(sample.depth_m), path.stem.partition("-")[0]
    more = "--more-cry cry_40M.h5 " if depth >= DEEP else ""
    command = (
        f"python models/make.py --cry cry_sea_level.h5 {more}--work work --depth {depth} --architecture {architecture}"
    )
    text = card(path, evaluation, command=command, provenance=sample.provenance, notes=notes)
    path.with_suffix(".md").write_text(text)
    click.echo(text)


def write_manifest() -> None:
    """List every released file with its hash and metadata; the default is the architecture that measures best."""
    models = [manifest_entry(path) for path in sorted(RELEASED.glob("*.onnx"))]
    models.sort(key=lambda entry: (entry["architecture"], float(entry["depth_m"])))
    manifest = {"manifest_version": 1, "default_architecture": "quantile", "models": models}
    (RELEASED / "manifest.json").write_text(json.dumps(manifest, indent=2) + "\n")


if __name__ == "__main__":
    main()
