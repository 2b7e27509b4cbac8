"""Evaluates an ONNX model against held-out muons: drawn, compared, and described by what the model says of itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from deepmuon_runtime.generator import Generator
from deepmuon_training.sample import Sample
from deepmuon_training.scores.evaluate import evaluate
from deepmuon_training.scores.evaluation import Evaluation

__all__ = ["evaluate_model"]


def evaluate_model(
    model: Path,
    held_out: Sample,
    muons: int,
    *,
    seed: int,
    raw: Sample | None = None,
    unphysical_before_mapping: float | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> Evaluation:
    """Draw muons from a model and compare them with held-out ones.

    Parameters
    ----------
    model
        Any ONNX file that keeps the contract.
    held_out
        Muons that it was not trained on.
    muons
        How many to draw.
    seed
        Of these, and of the classifier.
    raw
        Held-out muons with the histogram steps still in, if there are any.
    unphysical_before_mapping
        As for `deepmuon_training.scores.evaluate.evaluate`.
    progress
        Called with the number of muons drawn since the last call.

    Raises
    ------
    RefusedError
        If the model can't be opened, or there are too few muons of either.
    FailedError
        If the model gives an unphysical muon.
    """
    generator = Generator.open(file=model, device="cpu")
    facts = generator.model
    drawn = []
    for piece in generator.chunks(muons, seed):
        drawn.append(piece)
        progress(len(piece))
    return evaluate(
        drawn,
        held_out.muons,
        seed=seed,
        muons_per_draw=facts.muons_per_draw,
        raw_truth=None if raw is None else raw.muons,
        generated_rate=_rate(facts.rate_hz_per_m2, facts.rate_uncertainty_hz_per_m2),
        truth_rate=_rate(held_out.rate, held_out.rate_uncertainty),
        energy_range=(facts.energy_min_gev, facts.energy_max_gev),
        unphysical_before_mapping=unphysical_before_mapping,
    )


def _rate(rate: float | None, uncertainty: float | None) -> tuple[float, float] | None:
    """Return a rate with its uncertainty, 0 where nobody stated one."""
    return None if rate is None else (rate, uncertainty or 0.0)
