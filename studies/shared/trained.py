"""A generator of a sample, as a user would make it: fitted, exported, opened; what is there is not made again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from deepmuon_runtime import Generator
from deepmuon_training.generators.fit import fit_generator
from deepmuon_training.generators.fitted import export_fitted
from deepmuon_training.sample import Sample

__all__ = ["SEED", "trained"]

SEED = 1


def trained(sample: Sample, architecture: str, stem: Path, settings: Any = None) -> Generator:
    """Return the generator of STEM.onnx; an interrupted fit goes on from STEM.checkpoints.

    The settings are those of the architecture.
    """
    path = stem.with_suffix(".onnx")
    if not path.exists():
        checkpoints = stem.with_suffix(".checkpoints")
        checkpoints.mkdir(parents=True, exist_ok=True)
        fitted = fit_generator(sample, architecture, seed=SEED, settings=settings, checkpoint_folder=checkpoints)
        export_fitted(fitted, path)
    return Generator.open(file=path, device="cpu")
