"""Puts the `transformer` models of release 0.1.0, whose networks are not kept, into this release's form.

    python models/first_models.py FOLDER

The folder holds the ONNX files of release 0.1.0. A model keeps all its numbers, its scores, and what its card says of
itself. (The `quantile` models are made anew: models/make_family.py.)
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import onnx

from deepmuon_runtime.model.metadata import METADATA_PREFIX
from deepmuon_training.export.metadata import Training
from deepmuon_training.export.onnx_export import export
from deepmuon_training.generators.read_back import read_numbers
from deepmuon_training.release.card import card
from deepmuon_training.release.flux_notes import flux_notes
from deepmuon_training.release.vectors import muon_vectors
from deepmuon_training.scores.evaluation import Evaluation
from make import ARCHITECTURE, EVALUATIONS, RELEASED, VECTORS, command, depth_of, write_manifest

FLUX = "cry"
THIS = "The numbers of release 0.1.0"
"""Begins the note of this program."""


def training_of(contents: bytes) -> Training:
    """Return what the metadata of a file of release 0.1.0 says of its training."""
    model = onnx.load_from_string(contents)
    known = {prop.key.removeprefix(METADATA_PREFIX): prop.value for prop in model.metadata_props}
    return Training(
        depth_m=float(known["depth_m"]),
        medium=known["medium"],
        source=known["training_source"],
        provenance=(),
        rate=float(known["rate_hz_per_m2"]),
        rate_uncertainty=float(known["rate_uncertainty_hz_per_m2"]),
        smoothed=known["training_smoothed"] == "true",
        muons=int(known["training_muons"]),
        seed=int(known["training_seed"]),
        flux=FLUX,
    )


def own_notes(known: str) -> tuple[list[str], list[str]]:
    """Return what a card says of the model's muons, and of the model alone."""
    before, _, limits = known.partition("\n## Limits\n")
    general = flux_notes(FLUX).limits
    notes = [line for line in re.findall(r"^- (.*)$", limits, re.MULTILINE) if line not in general]
    return re.findall(r"^1\. (.*)$", before, re.MULTILINE), [note for note in notes if not note.startswith(THIS)]


def release(old: Path) -> None:
    """Put a model of release 0.1.0 where it is released, in this release's form, with its test vectors and card."""
    contents, new = old.read_bytes(), RELEASED / old.name
    mismatch = export(read_numbers(contents), training_of(contents), new, overwrite=True)
    (VECTORS / f"{new.stem}.json").write_text(muon_vectors(new), encoding="utf-8")
    evaluation = Evaluation.from_json((EVALUATIONS / f"{new.stem}.json").read_text(encoding="utf-8"))
    provenance, notes = own_notes(new.with_suffix(".md").read_text(encoding="utf-8"))
    this = (
        f"{THIS} in the form of this one (`python models/first_models.py`): the scores above are those of the file of "
        f"0.1.0. {mismatch.note}"
    )
    text = card(new, evaluation, command=command(depth_of(new.stem)), provenance=provenance, notes=[this, *notes])
    new.with_suffix(".md").write_text(text, encoding="utf-8")
    print(f"{new.name}: {new.stat().st_size} bytes, {mismatch}")


if __name__ == "__main__":
    for path in sorted(Path(sys.argv[1]).glob(f"{ARCHITECTURE}-*.onnx")):
        release(path)
    write_manifest()
