"""The card of a model: what made it, what it scores, where it ends; in Markdown."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import onnx

from deepmuon_runtime.model.metadata import METADATA_PREFIX
from deepmuon_training.release.flux_notes import flux_notes
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.scorecard import markdown_scorecard

__all__ = ["card", "manifest_entry"]


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
    known = flux_notes(str(metadata["flux"]) if "flux" in metadata else None)
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
            known.credit,
            "",
            "## Scores",
            "",
            f"{generated} generated muons against {held_out} held-out ones, which trained nothing. *Alike samples* is "
            "what two samples of one distribution and these sizes show.",
            "",
            markdown_scorecard(evaluation, str(metadata["architecture"])),
            "## Limits",
            "",
            *(f"- {limit}" for limit in (*notes, *known.limits)),
            "",
        ]
    )
