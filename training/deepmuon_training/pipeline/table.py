"""The table with which a pipeline ends: a row for each depth."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from deepmuon_runtime.muon_file.reader import read_attributes, read_pieces
from deepmuon_training.pipeline.layer import Layer
from deepmuon_training.sample import read_sample
from deepmuon_training.scores.evaluation import Evaluation

__all__ = ["Row", "as_csv", "as_text", "rows"]

_CHUNK = 1 << 20  # muons read at once


@dataclass(frozen=True)
class Row:
    """One depth of a finished pipeline; None where something is not known.

    Parameters
    ----------
    depth_m
        Metres of overburden.
    rate_hz_per_m2, rate_uncertainty_hz_per_m2
        Muons per second and m2.
    surviving_fraction, surviving_fraction_error
        Of the muons of the first row; the error is that of counting.
    mean_energy_gev, mean_energy_error_gev
        Mean kinetic energy of the muons that the generator learned.
    muons
        How many these were.
    model
        File of the generator.
    chi2_per_ndf, delta, auc
        Scores of the generator against held-out muons: on CRY's cells, the difference beyond noise, the classifier.
    """

    depth_m: float
    rate_hz_per_m2: float | None
    rate_uncertainty_hz_per_m2: float | None
    surviving_fraction: float
    surviving_fraction_error: float
    mean_energy_gev: float
    mean_energy_error_gev: float
    muons: int
    model: str
    chi2_per_ndf: float | None
    delta: float | None
    auc: float | None


def rows(layers: Sequence[Layer]) -> list[Row]:
    """Return the rows of layers whose steps are done, from top to bottom."""
    fraction, variance = 1.0, 0.0  # the latter relative
    found = []
    for layer, above in zip(layers, [None, *layers[:-1]], strict=True):
        if above is not None:
            survived, started = _count(layer.sample), _count(above.carried)
            fraction *= survived / started
            variance += 1 / survived - 1 / started
        sample, (mean, error) = read_sample(layer.sample, 0, 0), _mean_energy(layer.sample)
        scores = _scores(layer)
        found.append(
            Row(
                layer.depth_m,
                sample.rate,
                sample.rate_uncertainty,
                fraction,
                fraction * math.sqrt(variance),
                mean,
                error,
                _count(layer.sample),
                layer.model.name,
                *scores,
            )
        )
    return found


def _count(path: Path) -> int:
    return int(read_attributes(path)["count"])


def _mean_energy(path: Path) -> tuple[float, float]:
    """Return the mean kinetic energy [GeV] of a file's muons, and its standard error."""
    number = _count(path)
    total, squares = 0.0, 0.0
    for muons in read_pieces(path, _CHUNK):
        energy = muons.kinetic_energy.astype(np.float64)
        total, squares = total + energy.sum(), squares + np.square(energy).sum()
    mean = total / number
    return float(mean), math.sqrt(max(0.0, squares / number - mean**2) / number)


def _scores(layer: Layer) -> tuple[float | None, float | None, float | None]:
    """Return chi2/ndf, delta and AUC, where the layer's generator was compared."""
    if layer.held_out is None:
        return None, None, None
    evaluation = Evaluation.from_json(layer.evaluation.read_text())
    return evaluation.cells.chi_square.per_ndf, evaluation.cells.delta, evaluation.classifier.auc


def as_csv(table: Sequence[Row]) -> str:
    """Write rows as CSV, with a line of names; what is not known is empty."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(Row)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in table)
    return text.getvalue()


def as_text(table: Sequence[Row]) -> str:
    """Write rows as aligned columns."""
    head = ["depth/m", "rate/(1/m2/s)", "surviving fraction", "mean energy/GeV", "muons", "model"]
    lines = [
        [
            f"{row.depth_m:g}",
            _measured(row.rate_hz_per_m2, row.rate_uncertainty_hz_per_m2),
            _measured(row.surviving_fraction, row.surviving_fraction_error),
            _measured(row.mean_energy_gev, row.mean_energy_error_gev),
            f"{row.muons:,}",
            row.model,
        ]
        for row in table
    ]
    if any(row.auc is not None for row in table):
        head += ["chi2/ndf", "delta", "AUC"]
        for line, row in zip(lines, table, strict=True):
            line += ["" if score is None else f"{score:.4g}" for score in (row.chi2_per_ndf, row.delta, row.auc)]
    widths = [max(map(len, column)) for column in zip(head, *lines, strict=True)]
    return "\n".join(
        "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in (head, *lines)
    )


def _measured(value: float | None, error: float | None) -> str:
    """Write a value with two digits of its error."""
    if value is None:
        return "unknown"
    if not error:
        return f"{value:.6g}"
    digits = max(0, 1 - math.floor(math.log10(error)))
    return f"{value:.{digits}f} +- {error:.{digits}f}"
