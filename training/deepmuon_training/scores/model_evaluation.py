"""Evaluates an ONNX model against held-out muons: drawn, compared, and described by what the model says of itself.

Muons through a sphere are compared with those of a horizontal plane, which all samples are: kept with a probability of
cos zenith, they are just these. Weights of 1 / cos zenith on the held-out muons would say the same with far more noise:
at sea level one muon of twenty million, of cos zenith 1e-6, is 3 % of their sum.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import isclose
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.generator import Generator
from deepmuon_runtime.model.family import at_depth
from deepmuon_runtime.model.metadata import SPHERE, Model
from deepmuon_runtime.muons import Muons
from deepmuon_training.medium import model_medium
from deepmuon_training.sample import Sample
from deepmuon_training.scores.evaluate import evaluate
from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.totals import Rate

__all__ = ["evaluate_model"]


def evaluate_model(
    model: Path,
    held_out: Sample,
    muons: int,
    *,
    seed: int,
    raw: Sample | None = None,
    unphysical_before_mapping: float | None = None,
    variance_factor: float | None = None,
    depth: float | None = None,
    surface: int | None = None,
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
    variance_factor
        As for the same; if left out what the held-out muons' file says, or 1.
    depth
        Of a family: metres at which it is scored; if left out, that which it is loaded with.
    surface
        Of a family: 0 for its muons through a horizontal plane, 1 for those through a sphere; if left out, as above.
    progress
        Called with the number of muons drawn since the last call.

    Raises
    ------
    RefusedError
        If the model can't be opened, is of another depth or medium, or there are too few muons of either.
    FailedError
        If the model gives an unphysical muon.
    """
    with _placed(model, depth, surface) as file:
        generator = Generator.open(file=file, depth=depth, device="cpu")
    facts = generator.model
    _check_place(facts, held_out)
    drawn, random = [], np.random.default_rng(seed)
    for piece in generator.chunks(muons, seed):
        drawn.append(_through_plane(piece, random) if facts.surface == SPHERE else piece)
        progress(len(piece))
    kept = sum(map(len, drawn)) / muons
    rate, uncertainty = facts.rate_hz_per_m2, facts.rate_uncertainty_hz_per_m2
    found = evaluate(
        drawn,
        held_out.muons,
        seed=seed,
        muons_per_draw=facts.muons_per_draw,
        raw_truth=None if raw is None else raw.muons,
        generated_rate=_rate(rate and rate * kept, uncertainty and uncertainty * kept),
        truth_rate=_rate(held_out.rate, held_out.rate_uncertainty),
        variance_factor=variance_factor or held_out.variance_factor or 1.0,
        energy_range=(facts.energy_min_gev, facts.energy_max_gev),
        unphysical_before_mapping=unphysical_before_mapping,
    )
    return replace(found, surface=facts.surface)


@contextmanager
def _placed(model: Path, depth: float | None, surface: int | None) -> Iterator[Path]:
    """Give a family's file with a surface in it, where one is asked for."""
    if surface is None:
        yield model
        return
    place = Generator.open(file=model, depth=depth, device="cpu").model.depth_m
    with TemporaryDirectory() as folder:
        file = Path(folder) / model.name
        file.write_bytes(at_depth(model.read_bytes(), place, surface, str(model)))
        yield file


def _through_plane(muons: Muons, random: np.random.Generator) -> Muons:
    """Of muons through a sphere, choose those that a horizontal plane has."""
    return muons[random.random(len(muons)) < muons.cos_zenith]


def _check_place(model: Model, held_out: Sample) -> None:
    """Refuse muons of another place: two depths differ by far more than any generator from its sample."""
    same_depth = isclose(model.depth_m, held_out.depth_m, rel_tol=1e-5, abs_tol=1e-5)
    medium, other = model_medium(model.medium), model_medium(held_out.medium)
    if not same_depth or (held_out.depth_m > 0 and medium != other):
        raise RefusedError(
            f"{model.name} gives muons under {model.depth_m:g} m of {medium}, and the held-out ones are from "
            f"under {held_out.depth_m:g} m of {other}: compare muons of one place"
        )


def _rate(rate: float | None, uncertainty: float | None) -> Rate | None:
    return None if rate is None else (rate, uncertainty)
