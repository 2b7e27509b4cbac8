"""Fits a generator of any architecture to a sample."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Literal

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY, first_unphysical
from deepmuon_training.energy_transform import box_cox
from deepmuon_training.export.onnx_export import Training
from deepmuon_training.generators.fitted import FittedGenerator
from deepmuon_training.generators.quantile.fit import QuantileSchedules, fit_quantile
from deepmuon_training.generators.quantile.maps import QuantileGenerator
from deepmuon_training.generators.transformer.fit import TransformerSettings, fit_transformer
from deepmuon_training.generators.transformer.model import ChargeTable, TransformerModel, radius_table, raw_muons
from deepmuon_training.learning.charge import fit_charge
from deepmuon_training.learning.uniform_azimuth import check_uniform_azimuth
from deepmuon_training.sample import Sample

__all__ = ["ARCHITECTURES", "FEWEST_MUONS", "Azimuth", "Settings", "check_sample", "fit_generator"]

FEWEST_MUONS = 3000
"""Muons that a sample must hold: fewer say too little of the tails, and of the angles at any energy."""

Azimuth = Literal["uniform", "learned"]
Settings = QuantileSchedules | TransformerSettings

ARCHITECTURES: dict[str, type[Settings]] = {"quantile": QuantileSchedules, "transformer": TransformerSettings}
"""The settings of each architecture's fit, by its name."""

_LEARNED_AZIMUTH = (
    "The azimuth is learned, given energy and zenith: 16 harmonics of its logarithmic density, in steps of 2.8 degrees."
)


def fit_generator(
    sample: Sample,
    architecture: str,
    *,
    seed: int,
    settings: Settings | None = None,
    azimuth: Azimuth = "uniform",
    checkpoint_folder: Path | None = None,
    progress: bool = True,
) -> FittedGenerator:
    """Fit a generator to a sample, the last twentieth of which (500,000 muons at most) validates.

    The number of threads (``torch.set_num_threads``) belongs to the result: other numbers round otherwise.

    Parameters
    ----------
    sample
        Independent muons in no particular order.
    architecture
        "quantile" or "transformer".
    seed
        Of weights and batches.
    settings
        How long to train, `ARCHITECTURES[architecture]`; the default made the released models.
    azimuth
        Of a `quantile` generator: "uniform", where that is so, or "learned". A `transformer` always learns it.
    checkpoint_folder
        Existing folder for checkpoints, from which an interrupted fit of the same sample goes on.
    progress
        Whether to show progress bars.

    Raises
    ------
    RefusedError
        If the sample can't be learned (`check_sample`), its azimuth is to be uniform and is not, or a checkpoint is
        of another sample, seed or settings.
    FailedError
        If the training diverges.
    """
    if architecture not in ARCHITECTURES:
        raise RefusedError(f"there is no architecture {architecture}, only {' and '.join(ARCHITECTURES)}")
    check_sample(sample)
    settings = settings or ARCHITECTURES[architecture]()
    if isinstance(settings, TransformerSettings):
        return _fit_transformer(sample, settings, seed, checkpoint_folder, progress)
    return _fit_quantile(sample, settings, seed, azimuth, checkpoint_folder, progress)


def check_sample(sample: Sample) -> None:
    """Tell whether a sample can be learned, before any time is spent on it.

    Raises
    ------
    RefusedError
        If it has too few muons, or one that can't be: not downward, no unit vector, no number, or with a kinetic energy
        out of 1 MeV to 100 TeV.
    """
    if len(sample) < FEWEST_MUONS:
        raise RefusedError(f"{len(sample)} muons are too few to learn from: at least {FEWEST_MUONS} are needed")
    bad = first_unphysical(sample.muons, LOWEST_ENERGY, HIGHEST_ENERGY)
    if bad is not None:
        raise RefusedError(f"the sample can't be learned: muon number {bad[0]} {bad[1]}")


def _fit_quantile(
    sample: Sample, settings: QuantileSchedules, seed: int, azimuth: Azimuth, folder: Path | None, progress: bool
) -> FittedGenerator:
    if azimuth == "uniform":
        check_uniform_azimuth(sample.muons)
    networks = fit_quantile(
        sample.muons,
        seed=seed,
        schedules=settings,
        learn_azimuth=azimuth == "learned",
        checkpoint_folder=folder,
        progress=progress,
    )
    return FittedGenerator(networks, Training.of(sample, seed), asdict(settings), _quantile_notes(networks), None)


def _quantile_notes(networks: QuantileGenerator) -> tuple[str, ...]:
    tails, clip = networks.tails, networks.condition
    low, high = (float(energy) for energy in networks.transform.energy(np.array([clip.low, clip.high])))
    return (
        f"Above {tails.high:.0f} GeV, where the training sample thins out, the flux above E goes as "
        f"E^-{tails.high_exponent:.2f}, up to {HIGHEST_ENERGY:.0e} GeV; below {1000 * tails.low:.1f} MeV the flux "
        f"under E goes as E^{tails.low_exponent:.2f}, down to 1 MeV.",
        f"Muons above {high:.0f} GeV share one distribution of angles and charges; so do those below {1000 * low:.1f} "
        "MeV.",
        *(() if networks.azimuth is None else (_LEARNED_AZIMUTH,)),
    )


def _fit_transformer(
    sample: Sample, settings: TransformerSettings, seed: int, folder: Path | None, progress: bool
) -> FittedGenerator:
    """Fit the paper's network, and add what it lacks: true zenith angles and charges."""
    muons = sample.muons
    checkpoint, charge_checkpoint = (folder and folder / name for name in ("transformer.pt", "charge.pt"))
    network, transform = fit_transformer(muons, seed=seed, settings=settings, checkpoint=checkpoint, progress=progress)
    charge = fit_charge(
        muons, transform, seed=seed, schedule=settings.charge, checkpoint=charge_checkpoint, progress=progress
    )
    energy_range = LOWEST_ENERGY, float(muons.kinetic_energy.max())
    model = TransformerModel.stored(
        network,
        transform=transform,
        angle=radius_table(network, muons, seed=seed, generated=settings.calibration),
        charge=ChargeTable.of(charge, transform),
        energy_range=energy_range,
    )
    raw = raw_muons(model.network, settings.calibration // 2, seed=(seed + 1) % 2**64)
    energy, radius = box_cox(raw[:, 0] + transform.mean).numpy(), raw[:, 1:].norm(dim=1).numpy()
    outside = (energy < energy_range[0]) | (energy > energy_range[1])
    grazing = np.mean((radius < 1) & (radius > np.sqrt(1 - 0.2**2)))
    truth = np.mean(muons.cos_zenith < 0.2)
    notes = (
        f"The {model.muons_per_draw} muons of a draw are a stratified, correlated set.",
        f"Of the bare network's muons {np.mean(radius >= 1):.2%} have cos2 x + cos2 y > 1, and {grazing:.3%} have cos "
        f"zenith < 0.2, where the training sample has {truth:.3%}: the graph's table of zenith angles mends both. "
        f"{np.mean(outside):.4%} have an energy outside of {energy_range[0]:g} to {energy_range[1]:.0f} GeV, to which "
        "it is clipped.",
    )
    unphysical = float(np.mean((radius >= 1) | outside))
    return FittedGenerator(model, Training.of(sample, seed), asdict(settings), notes, unphysical)
