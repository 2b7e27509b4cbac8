"""The `quantile` architecture, in one object."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.export.stored import StoredGenerator
from deepmuon_training.families.rates import KnownRate
from deepmuon_training.generators.architecture import Architecture, Azimuth, Fit
from deepmuon_training.generators.quantile.azimuth_fit import AzimuthDensity
from deepmuon_training.generators.quantile.family import QuantileFamily, quantile_family
from deepmuon_training.generators.quantile.fit import QuantileSchedules, fit_quantile
from deepmuon_training.generators.quantile.maps import QuantileGenerator
from deepmuon_training.generators.quantile.tables import QuantileTables, table_error, tabulate
from deepmuon_training.learning.charge import ChargeProbability
from deepmuon_training.learning.condition import EnergyCondition
from deepmuon_training.learning.power_law import PowerLawTails
from deepmuon_training.learning.support import Support
from deepmuon_training.learning.uniform_azimuth import check_uniform_azimuth
from deepmuon_training.records import from_json, to_json
from deepmuon_training.sample import Sample

__all__ = ["ARCHITECTURE"]

_LEARNED_AZIMUTH = (
    "The azimuth is learned, given energy and zenith: 16 harmonics of its logarithmic density, in steps of 2.8 degrees."
)


class _Quantile(Architecture[QuantileSchedules, QuantileGenerator]):
    """A triangular map of one-dimensional quantile functions: one muon a draw, independent by construction."""

    name = "quantile"
    settings = QuantileSchedules
    checkpoints = ("charge.pt", "azimuth.pt", "zenith.pt")
    makes_families = True

    def fit(
        self,
        sample: Sample,
        settings: QuantileSchedules,
        *,
        seed: int,
        azimuth: Azimuth,
        support: Support,
        checkpoint_folder: Path | None,
        progress: bool,
    ) -> Fit[QuantileGenerator]:
        if azimuth == "uniform":
            check_uniform_azimuth(sample.muons)
        networks = fit_quantile(
            sample.muons,
            seed=seed,
            schedules=settings,
            learn_azimuth=azimuth == "learned",
            support=support,
            checkpoint_folder=checkpoint_folder,
            progress=progress,
        )
        return Fit(networks, _notes(networks), None)

    def pack(self, networks: QuantileGenerator) -> dict[str, Any]:
        return {
            "mean": networks.transform.mean,
            "tails": to_json(networks.tails),
            "condition": to_json(networks.condition),
            "learned_azimuth": networks.azimuth is not None,
            "cos_zenith_min": networks.cos_zenith_min,
            "weights": networks.state_dict(),
        }

    def unpack(self, parts: dict[str, Any]) -> QuantileGenerator:
        condition, tails = from_json(EnergyCondition, parts["condition"]), from_json(PowerLawTails, parts["tails"])
        azimuth = AzimuthDensity(condition) if parts["learned_azimuth"] else None
        networks = QuantileGenerator(
            EnergyTransform(parts["mean"]), tails, ChargeProbability(condition), azimuth, parts["cos_zenith_min"]
        )
        networks.load_state_dict(parts["weights"])
        return networks

    def exportable(self, networks: QuantileGenerator, seed: int) -> tuple[QuantileTables, tuple[str, ...]]:
        tables = tabulate(networks)
        return tables, (str(table_error(networks, tables, seed=seed)),)

    def family(
        self, knots: Sequence[tuple[float, QuantileTables]], density: float, rates: Sequence[KnownRate]
    ) -> QuantileFamily:
        return quantile_family(knots, density, rates)

    def read_back(self, stored: StoredGenerator) -> QuantileTables:
        energy, zenith, charge = (stored.constants[f"{name}/table"] for name in ("energy", "zenith", "charge"))
        return QuantileTables(energy, zenith, charge, stored.energy_range, stored.energy_mean)


def _notes(networks: QuantileGenerator) -> tuple[str, ...]:
    tails, clip = networks.tails, networks.condition
    low, high = (float(energy) for energy in networks.transform.energy(np.array([clip.low, clip.high])))
    return (
        f"Above {tails.high:.0f} GeV, where the training sample thins out, the flux above E goes as "
        f"E^-{tails.high_exponent:.2f}, up to {tails.energy_max:g} GeV; below {1000 * tails.low:.1f} MeV the flux "
        f"under E goes as E^{tails.low_exponent:.2f}, down to "
        f"{1000 * tails.energy_min:g} MeV.",
        f"Muons above {high:.0f} GeV share one distribution of angles and charges; so do those below {1000 * low:.1f} "
        "MeV.",
        *(() if networks.azimuth is None else (_LEARNED_AZIMUTH,)),
    )


ARCHITECTURE = _Quantile()
