"""The `quantile` architecture, in one object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, astuple
from pathlib import Path
from typing import Any

import numpy as np
import torch

from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.export.stored import StoredGenerator
from deepmuon_training.families.rates import KnownRate
from deepmuon_training.generators.architecture import Architecture, Azimuth, Fit
from deepmuon_training.generators.quantile.azimuth_fit import AzimuthDensity
from deepmuon_training.generators.quantile.family import QuantileFamily, quantile_family
from deepmuon_training.generators.quantile.fit import QuantileSettings, fit_quantile
from deepmuon_training.generators.quantile.maps import QuantileGenerator
from deepmuon_training.generators.quantile.tables import QuantileTables, table_error, tabulate
from deepmuon_training.learning.condition import EnergyCondition
from deepmuon_training.learning.splines import Axis, Surface
from deepmuon_training.learning.support import Support
from deepmuon_training.learning.uniform_azimuth import check_uniform_azimuth
from deepmuon_training.sample import Sample

__all__ = ["ARCHITECTURE"]

_LEARNED_AZIMUTH = (
    "The azimuth is learned, given energy and zenith: 16 harmonics of its logarithmic density, in steps of 2.8 degrees."
)

_OUTERMOST_LEVEL = np.array([-1, 1]) * np.log(1e6 - 1)
"""Logit of the level beyond which a sample hardly says more of its spectrum than a power law."""


class _Quantile(Architecture[QuantileSettings, QuantileGenerator]):
    """A triangular map of one-dimensional quantile functions: one muon a draw, independent by construction."""

    name = "quantile"
    settings = QuantileSettings
    checkpoints = ("azimuth.pt",)
    makes_families = True

    def fit(
        self,
        sample: Sample,
        settings: QuantileSettings,
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
            settings=settings,
            learn_azimuth=azimuth == "learned",
            support=support,
            checkpoint_folder=checkpoint_folder,
            progress=progress,
        )
        return Fit(networks, _notes(networks), None)

    def pack(self, networks: QuantileGenerator) -> dict[str, Any]:
        azimuth, charge = networks.azimuth, networks.charge
        return {
            "mean": networks.transform.mean,
            "energy": _packed(networks.energy),
            "zenith": _packed(networks.zenith),
            "charge": _packed(charge) if isinstance(charge, Surface) else charge,
            "energy_range": networks.energy_range,
            "cos_zenith_min": networks.cos_zenith_min,
            "azimuth": None if azimuth is None else [asdict(azimuth.condition), azimuth.state_dict()],
        }

    def unpack(self, parts: dict[str, Any]) -> QuantileGenerator:
        azimuth, charge = None, parts["charge"]
        if parts["azimuth"] is not None:
            condition, weights = parts["azimuth"]
            azimuth = AzimuthDensity(EnergyCondition(**condition))
            azimuth.load_state_dict(weights)
        return QuantileGenerator(
            EnergyTransform(parts["mean"]),
            _unpacked(parts["energy"]),
            _unpacked(parts["zenith"]),
            _unpacked(charge) if isinstance(charge, dict) else charge,
            parts["energy_range"],
            parts["cos_zenith_min"],
            azimuth,
        )

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


def _packed(surface: Surface) -> dict[str, Any]:
    axes = [astuple(axis) for axis in (surface.x, surface.y)]
    return {"axes": axes, "coefficients": torch.from_numpy(surface.coefficients)}


def _unpacked(parts: dict[str, Any]) -> Surface:
    first, second = (Axis(*axis) for axis in parts["axes"])
    return Surface(first, second, parts["coefficients"].numpy())


def _notes(networks: QuantileGenerator) -> tuple[str, ...]:
    (lowest, highest), (low, high) = networks.energy_range, np.exp(networks.log_energy(_OUTERMOST_LEVEL))
    falling, rising = (
        float(np.diff(networks.energy(np.log([energy, energy * 1.001]), np.zeros(1))[:, 0])[0] / np.log(1.001))
        for energy in (high, low)
    )
    angles = np.exp(networks.log_energy(np.array([networks.zenith.x.low, networks.zenith.x.high])))
    return (
        f"Above {high:.0f} GeV, which one muon in a million has, the flux above E goes as E^{falling:.2f}, up to "
        f"{highest:g} GeV; below {1000 * low:.1f} MeV the flux under E goes as E^{rising:.2f}, down to "
        f"{1000 * lowest:g} MeV.",
        f"Muons above {angles[1]:.0f} GeV share one distribution of angles and charges; so do those below "
        f"{1000 * angles[0]:.1f} MeV.",
        *(() if networks.azimuth is None else (_LEARNED_AZIMUTH,)),
    )


ARCHITECTURE = _Quantile()
