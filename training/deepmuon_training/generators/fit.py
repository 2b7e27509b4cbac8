"""Fits a generator of any architecture to a sample."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY, first_unphysical
from deepmuon_training.export.metadata import Training
from deepmuon_training.generators.architecture import Azimuth
from deepmuon_training.generators.fitted import FittedGenerator
from deepmuon_training.generators.registry import architecture
from deepmuon_training.learning.degenerate import check_repeats, check_ties
from deepmuon_training.learning.support import Stated, Support
from deepmuon_training.learning.threads import one_thread
from deepmuon_training.sample import Sample

__all__ = ["FEWEST_MUONS", "check_sample", "fit_generator"]

FEWEST_MUONS = 3000
"""Muons that a sample must hold: fewer say too little of the tails, and of the angles at any energy."""


@one_thread()
def fit_generator(
    sample: Sample,
    name: str,
    *,
    seed: int,
    settings: Any = None,
    azimuth: Azimuth = "uniform",
    stated: Stated | None = None,
    checkpoint_folder: Path | None = None,
    progress: bool = True,
) -> FittedGenerator:
    """Fit a generator to a sample; the last twentieth (500,000 muons at most) validates what a network learns of it.

    Parameters
    ----------
    sample
        Independent muons in no particular order.
    name
        Of the architecture, one of `deepmuon_training.generators.registry.ARCHITECTURES`.
    seed
        Of weights and batches.
    settings
        How long to train, the `settings` of its `deepmuon_training.generators.architecture.Architecture`; their default
        made the released models.
    azimuth
        Of a `quantile` generator: "uniform", where that is so, or "learned". A `transformer` always learns it, and
        leaves no choice.
    stated
        Where the sample ends, if that is known; what is not, its muons tell (`deepmuon_training.learning.support`).
    checkpoint_folder
        Existing folder for checkpoints, from which an interrupted fit of the same sample goes on.
    progress
        Whether to show progress bars.

    Raises
    ------
    RefusedError
        If the sample can't be learned (`check_sample`), has muons outside of what is stated, its azimuth is to be
        uniform and is not, or a checkpoint is of another sample, seed or settings.
    FailedError
        If the training diverges.
    """
    kind = architecture(name)
    kind.check_azimuth(azimuth)
    check_sample(sample)
    settings = settings or kind.settings()
    support = Support.of(sample.muons, stated)
    fit = kind.fit(
        sample,
        settings,
        seed=seed,
        azimuth=azimuth,
        support=support,
        checkpoint_folder=checkpoint_folder,
        progress=progress,
    )
    training = Training.of(sample, seed, zenith_max=support.zenith_max, charge=support.charge)
    notes = (*([support.note] if support.note else []), *fit.notes)
    return FittedGenerator(name, fit.networks, training, asdict(settings), notes, fit.unphysical_before_mapping)


def check_sample(sample: Sample) -> None:
    """Tell whether a sample can be learned, before any time is spent on it.

    Raises
    ------
    RefusedError
        If it has too few muons, or one that can't be: not downward, no unit vector, no number, or with a kinetic energy
        out of 1 MeV to 100 TeV; if muons repeat one another, or many have the same energy.
    """
    if len(sample) < FEWEST_MUONS:
        raise RefusedError(f"{len(sample)} muons are too few to learn from: at least {FEWEST_MUONS} are needed")
    bad = first_unphysical(sample.muons, LOWEST_ENERGY, HIGHEST_ENERGY)
    if bad is not None:
        raise RefusedError(f"the sample can't be learned: muon number {bad[0]} {bad[1]}")
    check_repeats(sample.muons)
    check_ties(sample.muons)
