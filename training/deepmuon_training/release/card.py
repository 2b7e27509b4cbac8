"""The card of a model: what made it, what it scores, where it ends; in Markdown."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import onnx

from deepmuon_runtime.model.metadata import METADATA_PREFIX
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.scorecard import markdown_scorecard

__all__ = ["GENERAL_LIMITS", "card", "manifest_entry"]

GENERAL_LIMITS = (
    "Single muons: no bundles of one shower, no arrival times.",
    "Geant4's muon-nuclear interaction is left out; the overburden is a flat, laterally infinite slab of fresh water.",
    "CRY's flux is 16 % below what BESS-TeV measured near the vertical; its charge ratio is 1.07 at sea level, falling "
    "with energy and depth, instead of 1.2 and rising; no east-west effect, and one date and latitude.",
    "The rate's uncertainty is statistical. What is systematic is far more: 15 % of the flux at sea level; 0.2 % at "
    "50 m and 5 % at 1000 m for the muon-nuclear interaction.",
    "Near the horizon few muons were there to learn from: not beyond 81 degrees (cos zenith below 0.15).",
)
"""What no model trained on CRY and Geant4 knows."""


def manifest_entry(path: Path) -> dict[str, str | int]:
    """Return file, sha256, size and the contract's metadata (without their prefix) of an ONNX file."""
    contents = path.read_bytes()
    sha256 = hashlib.sha256(contents).hexdigest()
    entry: dict[str, str | int] = {"file": path.name, "sha256": sha256, "size": len(contents)}
    properties = onnx.load_from_string(contents).metadata_props
    return entry | {p.key.removeprefix(METADATA_PREFIX): p.value for p in properties}


def card(model: Path, evaluation: Evaluation, *, command: str, provenance: Sequence[str], notes: Sequence[str]) -> str:
    """Write the card of a released model.

    Parameters
    ----------
    model
        Its ONNX file.
    evaluation
        Against held-out muons.
    command
        Makes the model again.
    provenance
        What was done to the training muons, in order.
    notes
        What is particular to this model: differences between table and network, ends of the tables, and the like.
    """
    metadata = manifest_entry(model)
    held_out, generated = evaluation.held_out_muons, evaluation.generated_muons
    return "\n".join(
        [
            f"# {metadata['architecture']}, {metadata['depth_m']} m",
            "",
            f"Muons under {metadata['depth_m']} m of water, by the `{metadata['architecture']}` architecture.",
            "",
            "| | |",
            "|---|---|",
            *(f"| {key} | {value} |" for key, value in metadata.items()),
            "",
            "## What made it",
            "",
            *(f"1. {step}" for step in provenance),
            "",
            "```",
            command,
            "```",
            "",
            "CRY is by Lawrence Livermore National Laboratory (UCRL-CODE-227323, BSD-style licence).",
            "",
            "## Scores",
            "",
            f"{generated} generated muons against {held_out} held-out ones, which trained nothing. *Alike samples* is "
            "what two samples of one distribution and these sizes show.",
            "",
            markdown_scorecard(evaluation, str(metadata["architecture"])),
            "",
            "## Limits",
            "",
            *(f"- {limit}" for limit in (*notes, *GENERAL_LIMITS)),
            "",
        ]
    )
