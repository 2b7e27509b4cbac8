"""What 6,000 muons teach, against the full sample (the paper's figure 4): ten disjoint samples, each architecture.

    python -m studies.paper.small_samples --training training.h5 --held-out held_out.h5 --work work

Beside the generators stand the plain histogram of each sample, and the released models, which learned from all muons.
Finished fits and scores lie in the work folder and are not repeated.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
import torch
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from deepmuon_runtime import Generator, Muons, read_muons
from deepmuon_training.data.cry_cells import COS_ZENITH_EDGES
from deepmuon_training.generators.quantile.fit import QuantileSettings
from deepmuon_training.generators.transformer.fit import TransformerSettings
from deepmuon_training.learning.descent import Schedule
from deepmuon_training.reports.pictures import STYLE
from deepmuon_training.sample import Sample, read_sample
from deepmuon_training.scores.histograms import ENERGY_EDGES
from studies.shared.judged import Scores, scores
from studies.shared.options import FILE
from studies.shared.report import COLOURS, write
from studies.shared.trained import SEED, trained

SMALL = 6_000
REPETITIONS = 10
GENERATED = 2_000_000
SETTINGS: dict[str, Any] = {
    "quantile": QuantileSettings(),
    "transformer": TransformerSettings(
        batch=8192,
        schedule=Schedule(
            steps=3000, learning_rate=1e-3, weight_decay=0.01, averaging=0.998, validate_every=100, patience=16
        ),
    ),
}
"""The transformer's batches are about as large as the sample: those of the released models would show it six times."""
LEAST_SHARE = 0.01
"""Energy bins with a smaller share of the muons are not judged."""

BINS = ENERGY_EDGES[::2]
SHOWN = {
    "KS energy": ".4f",
    "KS u": ".4f",
    "KS v": ".4f",
    "KS cos zenith": ".4f",
    "cells: delta": ".1%",
    "tail above 100 GeV": ".2f",
    "tail above 300 GeV": ".2f",
    "tail cos zenith below 0.2": ".2f",
    "charge ratio": ".3f",
    "charge by cell: chi2/ndf": ".2f",
    "classifier: AUC": ".3f",
}
"""Scores in the table, and how they are written; tails are relative to those of the held-out muons."""

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Result:
    """Scores of one generator, and its counts relative to the held-out ones in bins of energy and cos zenith."""

    scores: Scores
    energy: Float
    cos_zenith: Float


@click.command(help=__doc__)
@click.option("--training", required=True, type=FILE, help="Smoothed CRY muons that may train.")
@click.option("--held-out", required=True, type=FILE, help="Smoothed CRY muons that may not.")
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Folder for models and scores.")
def main(training: Path, held_out: Path, work: Path) -> None:
    """Fit, sample and judge every generator, then write the summary."""
    torch.set_num_threads(1)
    work.mkdir(parents=True, exist_ok=True)
    sample, truth = read_sample(training), read_muons(held_out)
    parts = [slice(k * SMALL, (k + 1) * SMALL) for k in range(REPETITIONS)]
    small = [sample.then(f"muons {part.start} to {part.stop}", muons=sample.muons[part]) for part in parts]
    results: dict[str, list[Result]] = {}
    for name, muons_of in KINDS.items():
        stems = [work / f"{name}-{k}" for k in range(REPETITIONS)]
        results[name] = [judge(*muons_of(few, stem), truth, stem) for few, stem in zip(small, stems, strict=True)]
    for architecture in SETTINGS:
        released = Generator.open(0, architecture=architecture)
        judged = judge(*drawn(released), truth, work / f"{architecture}-released")
        results[f"{architecture}, all muons"] = [judged]
    enough = np.histogram(truth.kinetic_energy, BINS)[0] >= LEAST_SHARE * len(truth)
    summary = {name: summarise(of, enough) for name, of in results.items()}
    numbers = {"muons": SMALL, "samples": REPETITIONS, "generated": GENERATED, "generators": summary}
    write(Path(__file__), numbers, table(summary), draw(results))


def judge(muons: Muons, muons_per_draw: int, truth: Muons, stem: Path) -> Result:
    """Compare muons with the held-out ones; their scores are read from STEM.json where they were found before."""
    path = stem.with_suffix(".json")
    if not path.exists():
        path.write_text(json.dumps(scores(muons, truth, muons_per_draw)))
    energy, cos_zenith = (
        np.histogram(a, edges)[0] / len(muons) / (np.histogram(b, edges)[0] / len(truth))
        for a, b, edges in (
            (muons.kinetic_energy, truth.kinetic_energy, BINS),
            (muons.cos_zenith, truth.cos_zenith, COS_ZENITH_EDGES),
        )
    )
    return Result(json.loads(path.read_text()), energy, cos_zenith)


def drawn(generator: Generator) -> tuple[Muons, int]:
    """Muons of a generator, and how many it makes at a time."""
    return generator.sample(GENERATED, seed=SEED), generator.model.muons_per_draw


def generated(architecture: str) -> Callable[[Sample, Path], tuple[Muons, int]]:
    """Return what fits a generator to a sample, and draws from its ONNX file as a user would."""

    def muons(sample: Sample, stem: Path) -> tuple[Muons, int]:
        return drawn(trained(sample, architecture, stem, SETTINGS[architecture]))

    return muons


def of_histogram(sample: Sample, stem: Path) -> tuple[Muons, int]:
    """Muons of the sample's plain histogram: CRY's cells, uniform inside, each with its own charges.

    The few beyond the outermost edges, 10 MeV and 1 TeV, are put there.
    """
    random = np.random.default_rng(SEED)
    rows = random.integers(len(sample), size=GENERATED)
    few = sample.muons
    x = np.digitize(few.kinetic_energy, BINS)[rows] - 1 + random.random(GENERATED)
    c = (np.minimum(np.floor(few.cos_zenith * 20), 19)[rows] + random.random(GENERATED)) / 20
    energy = np.interp(x, np.arange(len(BINS)), np.log(BINS))
    azimuth, sine = 2 * np.pi * random.random(GENERATED), np.sqrt(1 - c**2)
    muons = Muons.of(
        np.exp(energy), sine * np.cos(azimuth), sine * np.sin(azimuth), -np.maximum(c, 1e-6), few.pdg_id[rows]
    )
    return muons, 1


KINDS: dict[str, Callable[[Sample, Path], tuple[Muons, int]]] = {
    "quantile": generated("quantile"),
    "transformer": generated("transformer"),
    "histogram": of_histogram,
}


def summarise(results: list[Result], enough: NDArray[np.bool_]) -> dict[str, object]:
    """Mean and standard deviation of every score; the bins' deviations in the mean of all samples."""
    bins = np.mean([result.energy for result in results], axis=0) - 1
    return {
        "scores": {name: _spread(result.scores[name] for result in results) for name in results[0].scores},
        "energy_bins": bins.tolist(),
        "zenith_bins": (np.mean([result.cos_zenith for result in results], axis=0) - 1).tolist(),
        "worst_energy_bin": max(bins[enough].tolist(), key=abs),
    }


def _spread(values: Iterable[float | None]) -> dict[str, float] | None:
    known = list(values)
    if None in known:
        return None
    return {"mean": float(np.mean(known)), "spread": float(np.std(known, ddof=1)) if len(known) > 1 else 0.0}


def table(summary: dict[str, dict[str, object]]) -> list[tuple[str, ...]]:
    """One row for each score."""
    rows = [("score", *summary)]
    for name, how in SHOWN.items():
        found = [of["scores"][name] for of in summary.values()]
        cells = [format(of["mean"], how) + (f" ± {of['spread']:{how}}" if of["spread"] else "") for of in found]
        rows.append((name, *cells))
    rows.append(("worst energy bin of the mean", *(f"{of['worst_energy_bin']:+.1%}" for of in summary.values())))
    return rows


def draw(results: dict[str, list[Result]]) -> Figure:
    """Draw each kind's counts relative to the held-out ones: mean and spread over the samples."""
    with rc_context(STYLE):
        figure = Figure(figsize=(10.5, 6.5), layout="constrained")
        for column, name in zip(figure.subplots(len(KINDS), 2, sharex="col").T, ("energy", "cos_zenith"), strict=True):
            edges = BINS if name == "energy" else COS_ZENITH_EDGES
            for axes, kind, colour in zip(column, KINDS, COLOURS, strict=False):
                band(axes, edges, np.array([getattr(result, name) for result in results[kind]]), colour)
                if kind in SETTINGS:
                    whole = getattr(results[f"{kind}, all muons"][0], name)
                    axes.stairs(whole, edges, baseline=None, color="black", label="of all muons")
                axes.set(title=f"{kind} of {SMALL:,} muons", ylim=(0.5, 1.5), ylabel="relative to held-out")
            column[0].legend(fontsize="small")
            column[-1].set(xlabel="kinetic energy / GeV" if name == "energy" else "cos zenith")
            if name == "energy":
                column[-1].set(xscale="log")
    return figure


def band(axes: Axes, edges: Float, ratios: Float, colour: str) -> None:
    """Draw the mean of ratios [samples, bins] and a band of their standard deviation."""
    mean, spread = ratios.mean(axis=0), ratios.std(axis=0, ddof=1)
    axes.stairs(mean, edges, baseline=None, color=colour, label="mean of all samples")
    axes.stairs(mean + spread, edges, baseline=mean - spread, fill=True, color=colour, alpha=0.2)
    axes.axhline(1, color="0.7", lw=0.7, zorder=0)


if __name__ == "__main__":
    main()
