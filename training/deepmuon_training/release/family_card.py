"""The card of a family: its knots, and its scores at and between them; in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from pathlib import Path

import numpy as np

from deepmuon_training.export.metadata import Training
from deepmuon_training.release.card import manifest_entry
from deepmuon_training.release.flux_notes import flux_notes
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.histograms import TailScore, compare_horizon

__all__ = ["family_card"]

_HEADING = (
    *("depth [m]", "", "generated", "held out", "KS energy", "KS cos zenith", "delta"),
    *(f"cos zenith {low:g} to {low + 0.05:g}" for low in (0, 0.05, 0.1, 0.15)),
    *("charge chi²/ndf", "AUC", "rate / held out"),
)


def family_card(
    model: Path,
    knots: Sequence[Training],
    evaluations: Mapping[tuple[float, int], Evaluation],
    *,
    command: str,
    notes: Sequence[str],
) -> str:
    """Write the card of a released family.

    Parameters
    ----------
    model
        Its ONNX file.
    knots
        What each was trained on, ascending in depth.
    evaluations
        Against held-out muons, by depth in metres and surface: 0 for a horizontal plane, 1 for a sphere.
    command
        Makes the family again.
    notes
        What is particular to it.
    """
    said = manifest_entry(model)
    range_ = f"{said['depth_min_m']} to {said['depth_max_m']} m"
    flux = str(said["flux"]) if "flux" in said else None
    known, of_flux = flux_notes(flux), "" if flux is None else f", flux {flux}"
    depths = {np.float32(knot.depth_m) for knot in knots}  # 0.1 and 0.2 m of water make no 0.3 in double precision
    return "\n".join(
        [
            f"# {said['architecture']}, {range_} of {said['medium']}{of_flux}",
            "",
            f"Muons under any depth of {range_} of {said['medium']} ({knots[-1].medium} in its samples), by the "
            f"`{said['architecture']}` architecture: a family.",
            "",
            "| | |",
            "|---|---|",
            *(f"| {key} | {value} |" for key, value in said.items()),
            "",
            "## What made it",
            "",
            "| knot [m] | muons | rate [1/m² s] |",
            "|---|---|---|",
            *(f"| {knot.depth_m:g} | {knot.muons:,} | {_rate(knot)} |" for knot in knots),
            "",
            "The deepest knot's muons:",
            "",
            *(f"1. {step}" for step in knots[-1].provenance),
            "",
            "```",
            command,
            "```",
            "",
            known.credit,
            "",
            "## Scores",
            "",
            "Generated muons against held-out ones, which trained nothing, at knots and between them. KS less what one "
            "pair of alike samples in a hundred exceeds; delta is the relative difference on CRY's cells beyond noise.",
            "",
            f"| {' | '.join(_HEADING)} |",
            "|---" * len(_HEADING) + "|",
            *_rows(evaluations, 0, depths),
            "",
            "Muons through a sphere, of those of them that cross a horizontal plane:",
            "",
            f"| {' | '.join(_HEADING)} |",
            "|---" * len(_HEADING) + "|",
            *_rows(evaluations, 1, depths),
            "",
            "## Limits",
            "",
            *(f"- {limit}" for limit in (*notes, *known.limits)),
            "",
        ]
    )


def _rate(knot: Training) -> str:
    if knot.rate is None:
        return "unknown"
    return f"{knot.rate:.6g}" + ("" if knot.rate_uncertainty is None else f" ± {knot.rate_uncertainty:.2g}")


def _rows(evaluations: Mapping[tuple[float, int], Evaluation], surface: int, knots: Set[np.float32]) -> Iterator[str]:
    for depth, of in sorted(evaluations):
        if of == surface:
            yield _row(depth, np.float32(depth) in knots, evaluations[depth, of])


def _row(depth: float, at_knot: bool, found: Evaluation) -> str:
    generated, held_out = (spectra.by_cos_zenith for spectra in (found.generated_spectra, found.held_out_spectra))
    horizon = compare_horizon(generated, held_out, found.variance_factor)
    rate = "" if found.rate is None else f"{found.rate.generated / found.rate.held_out:.4f}"
    cells = [
        f"{depth:g}",
        "knot" if at_knot else "between",
        f"{found.generated_muons:,}",
        f"{found.held_out_muons:,}",
        *(f"{found.ks[column].excess:+.4f}" for column in ("energy", "cos zenith")),
        f"{found.cells.delta:.2%}",
        *(_tail(tail) for tail in horizon),
        f"{found.charge.per_ndf:.2f}",
        f"{found.classifier.auc:.4f}",
        rate,
    ]
    return f"| {' | '.join(cells)} |"


def _tail(tail: TailScore) -> str:
    if tail.expected == 0:
        return "none expected"
    return f"{tail.found / tail.expected:.2f} ± {tail.error / tail.expected:.2f}"
