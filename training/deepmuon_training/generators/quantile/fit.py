"""Trains the `quantile` generator: charge, energy and zenith, one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from deepmuon_runtime.muons import Muons
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.generators.quantile.azimuth_fit import AZIMUTH_SCHEDULE, fit_azimuth
from deepmuon_training.generators.quantile.maps import QuantileGenerator
from deepmuon_training.generators.quantile.regression import RegressionSteps, regress, regress_conditional
from deepmuon_training.learning.charge import CHARGE_SCHEDULE, fit_charge
from deepmuon_training.learning.descent import Schedule
from deepmuon_training.learning.power_law import PowerLawTails
from deepmuon_training.learning.support import Support
from deepmuon_training.learning.validation import split

__all__ = ["QuantileSchedules", "fit_quantile"]


@dataclass(frozen=True)
class QuantileSchedules:
    """How the networks are trained; the default made the released models.

    Parameters
    ----------
    zenith
        Of the zenith map.
    charge
        Of the charge's probability.
    azimuth
        Of the azimuth's density, where it is learned.
    """

    zenith: RegressionSteps = RegressionSteps()
    charge: Schedule = CHARGE_SCHEDULE
    azimuth: Schedule = AZIMUTH_SCHEDULE


def fit_quantile(
    muons: Muons,
    *,
    seed: int,
    schedules: QuantileSchedules | None = None,
    learn_azimuth: bool = False,
    support: Support | None = None,
    checkpoint_folder: Path | None = None,
    progress: bool = True,
) -> QuantileGenerator:
    """Train a generator on muons, the last of which validate (`validation.training_rows`).

    Parameters
    ----------
    muons
        Independent muons in no particular order.
    seed
        Of weights and batches.
    schedules
        Steps and rates.
    learn_azimuth
        Whether the azimuth's density is learned; else it is uniform.
    support
        Where muons can be; if left out, what `Support.of` finds.
    checkpoint_folder
        Existing folder for the checkpoints charge.pt, azimuth.pt and zenith.pt, see
        `deepmuon_training.learning.descent.fit`.
    progress
        Whether to show progress bars.
    """
    schedules = schedules or QuantileSchedules()
    support = support or Support.of(muons)
    energy = muons.kinetic_energy.astype(np.float64)
    transform = EnergyTransform.fit(muons.kinetic_energy)
    charge_file, azimuth_file, zenith_file = (
        checkpoint_folder and checkpoint_folder / f"{name}.pt" for name in ("charge", "azimuth", "zenith")
    )
    charge = fit_charge(
        muons, transform, seed=seed, schedule=schedules.charge, checkpoint=charge_file, progress=progress
    )
    azimuth = None
    if learn_azimuth:
        azimuth = fit_azimuth(
            muons, transform, seed=seed, schedule=schedules.azimuth, checkpoint=azimuth_file, progress=progress
        )
    tails = PowerLawTails.fit(energy, energy_min=support.energy_min, energy_max=support.energy_max)
    torch.manual_seed(seed)
    generator = QuantileGenerator(transform, tails, charge, azimuth, support.cos_zenith_min)
    y = transform.pre_tanh(energy)
    regress(generator.energy, y, tails.level)
    condition = generator.condition(torch.from_numpy(y.astype(np.float32))).numpy()
    parts = split(condition, _cos_zenith_logit(muons))
    regress_conditional(generator.zenith, *parts, schedules.zenith, checkpoint=zenith_file, progress=progress)
    generator.join_tails()
    return generator


def _cos_zenith_logit(muons: Muons) -> NDArray[np.float32]:
    """Logit of cos zenith; 1 - cos zenith comes from the horizontal components, without a cancellation."""
    c = np.clip(muons.cos_zenith.astype(np.float64), 1e-6, 1)
    sine_squared = np.maximum(muons.u.astype(np.float64) ** 2 + muons.v.astype(np.float64) ** 2, 1e-12)
    return np.log(c * (1 + c) / sine_squared).astype(np.float32)
