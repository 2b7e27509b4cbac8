"""Scores of generated muons by name, and the rows of a table of them."""

from __future__ import annotations

from collections.abc import Mapping

from deepmuon_runtime import Generator, Muons
from deepmuon_training.scores.evaluate import evaluate
from deepmuon_training.scores.histograms import compare_cells, count_muons
from deepmuon_training.scores.kolmogorov_smirnov import kolmogorov_smirnov
from deepmuon_training.scores.scorecard import scorecard
from studies.shared.trained import SEED

__all__ = ["GENERATED", "Scores", "distances", "scores", "scores_of", "table"]

GENERATED = 20_000_000

Scores = dict[str, float | None]

SHOWN = {
    "KS energy": ("KS energy", ".5f"),
    "KS cos zenith": ("KS cos θ", ".5f"),
    "cells: delta": ("delta", ".2%"),
    "tail above 300 GeV": ("> 300 GeV", ".3f"),
    "tail cos zenith below 0.2": ("cos θ < 0.2", ".3f"),
    "classifier: AUC": ("AUC", ".4f"),
}
"""Scores in a table: their heads, and how they are written."""


def scores(muons: Muons, truth: Muons, muons_per_draw: int = 1) -> Scores:
    """Compare muons with held-out ones."""
    evaluation = evaluate(muons, truth, seed=SEED, muons_per_draw=muons_per_draw)
    return {score.name.split(",")[0]: score.value for score in scorecard(evaluation)}


def scores_of(generator: Generator, truth: Muons) -> Scores:
    """Compare twenty million muons of a generator with held-out ones."""
    return scores(generator.sample(GENERATED, seed=SEED), truth, generator.model.muons_per_draw)


def distances(muons: Muons, truth: Muons) -> dict[str, float]:
    """Compare muons with held-out ones on CRY's cells, by their energies and by their zenith angles, and no more."""
    cells = compare_cells(count_muons(muons), count_muons(truth))
    energy = kolmogorov_smirnov(muons.kinetic_energy, truth.kinetic_energy)
    return {
        "chi2_ndf": cells.chi_square.per_ndf,
        "delta": cells.delta,
        "ks_energy": energy.distance,
        "ks_cos_zenith": kolmogorov_smirnov(muons.cos_zenith, truth.cos_zenith).distance,
        "ks_noise": energy.mean_noise,
    }


def table(head: tuple[str, ...], results: Mapping[tuple[str, ...], Scores]) -> list[tuple[str, ...]]:
    """One row for each generator, whose name has as many parts as the head; tails are relative to the held-out ones."""
    rows = [(*head, *(title for title, _ in SHOWN.values()))]
    rows += [(*key, *(format(of[name], how) for name, (_, how) in SHOWN.items())) for key, of in results.items()]
    return rows
