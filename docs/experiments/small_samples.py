"""What 6,000 muons teach, against the full sample (the paper's figure 4): ten disjoint samples, each architecture.

    python docs/experiments/small_samples.py --training training.h5 --held-out held_out.h5 --work work

Finished fits lie in the work folder and are not repeated. Writes small_samples.json beside this script.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import click
import numpy as np
import torch

from deepmuon_runtime import Generator, Muons, read_muons
from deepmuon_training.architectures import Settings, fit_generator
from deepmuon_training.evaluate import Evaluation, evaluate
from deepmuon_training.fit import Schedule
from deepmuon_training.fitted import export_fitted
from deepmuon_training.histogram_scores import ENERGY_EDGES
from deepmuon_training.quantile_fit import QuantileSchedules
from deepmuon_training.sample import Sample, read_sample
from deepmuon_training.transformer_fit import TransformerSettings

SMALL = 6_000
REPETITIONS = 10
GENERATED = 2_000_000
SEED = 1
SETTINGS: dict[str, Settings] = {
    "quantile": QuantileSchedules(),
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

FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.command(help=__doc__)
@click.option("--training", required=True, type=FILE, help="Smoothed CRY muons that may train.")
@click.option("--held-out", required=True, type=FILE, help="Smoothed CRY muons that may not.")
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Folder for models and scores.")
def main(training: Path, held_out: Path, work: Path) -> None:
    """Fit, sample and judge every generator, then write the summary."""
    torch.set_num_threads(1)
    work.mkdir(parents=True, exist_ok=True)
    sample, truth = read_sample(training), read_muons(held_out)
    summary = {name: summarise([_scores(name, sample, k, truth, work) for k in range(REPETITIONS)]) for name in KINDS}
    text = json.dumps({"muons": SMALL, "samples": REPETITIONS, "generated": GENERATED, "scores": summary}, indent=1)
    Path(__file__).with_suffix(".json").write_text(text + "\n")
    click.echo(text)


def _scores(name: str, sample: Sample, k: int, truth: Muons, work: Path) -> dict[str, object]:
    """Scores of one generator, from the work folder where it was judged before."""
    path = work / f"{name}-{k}.json"
    if not path.exists():
        few = sample.then(f"muons {k * SMALL} to {(k + 1) * SMALL}", muons=sample.muons[k * SMALL : (k + 1) * SMALL])
        muons, draw = KINDS[name](few, work / f"{name}-{k}")
        evaluation = evaluate(muons, truth, seed=SEED, muons_per_draw=draw)
        path.write_text(json.dumps({"scores": short(evaluation), "deviations": deviations(muons, truth)}))
    found: dict[str, object] = json.loads(path.read_text())
    return found


def generated(architecture: str) -> Callable[[Sample, Path], tuple[Muons, int]]:
    """Return what fits a generator to a sample, and draws from its ONNX file as a user would."""

    def muons(sample: Sample, stem: Path) -> tuple[Muons, int]:
        path = stem.with_suffix(".onnx")
        if not path.exists():
            checkpoints = stem.with_suffix(".checkpoints")
            checkpoints.mkdir(exist_ok=True)
            settings = SETTINGS[architecture]
            fitted = fit_generator(sample, architecture, seed=SEED, settings=settings, checkpoint_folder=checkpoints)
            export_fitted(fitted, path)
        generator = Generator.open(file=path, device="cpu")
        return generator.sample(GENERATED, seed=SEED), generator.model.muons_per_draw

    return muons


def of_histogram(sample: Sample, stem: Path) -> tuple[Muons, int]:
    """Muons of the sample's plain histogram: CRY's cells, uniform inside, each with its own charges."""
    random = np.random.default_rng(SEED)
    rows = random.integers(len(sample), size=GENERATED)
    few = sample.muons
    x = np.digitize(few.kinetic_energy, ENERGY_EDGES[::2])[rows] - 1 + random.random(GENERATED)
    c = (np.minimum(np.floor(few.cos_zenith * 20), 19)[rows] + random.random(GENERATED)) / 20
    energy = np.interp(x, np.arange(len(ENERGY_EDGES[::2])), np.log(ENERGY_EDGES[::2]))
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


def short(evaluation: Evaluation) -> dict[str, float | None]:
    """Scores by name."""
    return {score.name.split(",")[0]: score.value for score in evaluation.scores()}


def deviations(muons: Muons, truth: Muons) -> list[float | None]:
    """Relative deviation of each energy bin, 5 to a decade; None where the truth has under 1 % of its muons."""
    p, q = (np.histogram(m.kinetic_energy, ENERGY_EDGES[::2])[0] / len(m) for m in (muons, truth))
    return [float(a / b - 1) if b >= LEAST_SHARE else None for a, b in zip(p, q, strict=True)]


def summarise(results: list[dict[str, object]]) -> dict[str, object]:
    """Mean and standard deviation of every score, and of every bin's deviation."""
    scores = {name: _spread([result["scores"][name] for result in results]) for name in results[0]["scores"]}
    bins = [_spread(list(column)) for column in zip(*(result["deviations"] for result in results), strict=True)]
    worst = max((entry["mean"] for entry in bins if entry), key=abs)
    return {"scores": scores, "energy_bins": bins, "worst_bin_mean": worst}


def _spread(values: list[float | None]) -> dict[str, float] | None:
    known = [value for value in values if value is not None]
    if len(known) < len(values):
        return None
    return {"mean": float(np.mean(known)), "spread": float(np.std(known, ddof=1))}


if __name__ == "__main__":
    main()
