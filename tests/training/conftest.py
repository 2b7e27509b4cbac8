"""A small sample and two small generators trained on it, once for all tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import settings
from numpy.typing import NDArray

from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.export.exportable import Exportable
from deepmuon_training.export.metadata import Training
from deepmuon_training.export.onnx_export import export
from deepmuon_training.fluxes.ecomug import plane_rate, sea_level_muons
from deepmuon_training.generators.quantile.fit import fit_quantile
from deepmuon_training.generators.quantile.maps import QuantileGenerator
from deepmuon_training.generators.quantile.tables import QuantileTables, tabulate
from deepmuon_training.generators.transformer.fit import TransformerSettings, fit_transformer
from deepmuon_training.generators.transformer.model import ChargeTable, TransformerModel, radius_table
from deepmuon_training.generators.transformer.network import Transformer
from deepmuon_training.learning.charge import ChargeProbability, fit_charge
from deepmuon_training.learning.descent import Schedule
from deepmuon_training.sample import Sample

settings.register_profile("unhurried", deadline=None)  # the processors may be busy
settings.load_profile("unhurried")

SAMPLE_SIZE = 100_000

CHARGE_SCHEDULE = Schedule(steps=120, learning_rate=0.02, averaging=0.95, validate_every=40)

TRANSFORMER_SETTINGS = TransformerSettings(
    d=16,
    batch=2048,
    directions=8,
    schedule=Schedule(steps=150, learning_rate=3e-3, averaging=0.95, validate_every=75),
)

Columns = NDArray[np.float64]


@pytest.fixture(scope="session", autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)  # other numbers of threads round otherwise


def positive_probability(kinetic_energy: Columns, cos_zenith: Columns) -> Columns:
    """The charges' truth: logit P(mu+) grows with energy and towards the vertical."""
    logit = 0.2 + 0.5 * np.log10(kinetic_energy) + 0.8 * (cos_zenith - 0.7)
    return 1 / (1 + np.exp(-logit))


def parametric_muons(n: int, seed: int) -> Muons:
    muons = sea_level_muons(n, seed=seed)
    probability = positive_probability(muons.kinetic_energy.astype(float), muons.cos_zenith.astype(float))
    positive = np.random.default_rng([seed, 1]).random(n) < probability
    return replace(muons, pdg_id=np.where(positive, MU_PLUS, MU_MINUS).astype(np.int8))


@pytest.fixture(scope="session")
def truth() -> Callable[[int, int], Muons]:
    """Draws a number of muons, with a seed, from the distribution that the generators are trained on."""
    return parametric_muons


@pytest.fixture(scope="session")
def charge_truth() -> Callable[[Columns, Columns], Columns]:
    """P(mu+) of the same, at kinetic energies [GeV] and cos zenith."""
    return positive_probability


@pytest.fixture(scope="session")
def sample() -> Sample:
    return Sample(
        parametric_muons(SAMPLE_SIZE, seed=1),
        depth_m=0.0,
        source="a parametric flux",
        provenance=("100000 muons drawn",),
        rate=plane_rate(),
        rate_uncertainty=0.25,
        smoothed=True,
    )


@pytest.fixture(scope="session")
def quantile(sample: Sample) -> QuantileGenerator:
    return fit_quantile(sample.muons, seed=1, progress=False)


@pytest.fixture(scope="session")
def quantile_tables(quantile: QuantileGenerator) -> QuantileTables:
    return tabulate(quantile)


@pytest.fixture(scope="session")
def transform(sample: Sample) -> EnergyTransform:
    return EnergyTransform.fit(sample.muons.kinetic_energy)


@pytest.fixture(scope="session")
def charge(sample: Sample, transform: EnergyTransform) -> ChargeProbability:
    return fit_charge(sample.muons, transform, seed=1, schedule=CHARGE_SCHEDULE, progress=False)


@pytest.fixture(scope="session")
def transformer(sample: Sample) -> Transformer:
    return fit_transformer(sample.muons, seed=1, settings=TRANSFORMER_SETTINGS, progress=False)[0]


@pytest.fixture(scope="session")
def transformer_model(
    sample: Sample, transformer: Transformer, transform: EnergyTransform, charge: ChargeProbability
) -> TransformerModel:
    return TransformerModel.stored(
        transformer,
        transform=transform,
        angle=radius_table(transformer, sample.muons, seed=1, generated=500_000),
        charge=ChargeTable.of(charge, transform),
        energy_range=(1e-3, float(sample.muons.kinetic_energy.max())),
    )


@pytest.fixture(scope="session", params=["quantile", "transformer"])
def architecture(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="session")
def exportable(architecture: str, request: pytest.FixtureRequest) -> Exportable:
    """The small generator of each architecture."""
    fixture = {"quantile": "quantile_tables", "transformer": "transformer_model"}[architecture]
    generator: Exportable = request.getfixturevalue(fixture)
    return generator


@pytest.fixture(scope="session")
def model(exportable: Exportable, sample: Sample, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of each, exported."""
    path = tmp_path_factory.mktemp("models") / f"{exportable.architecture}.onnx"
    export(exportable, Training.of(sample, seed=1), path)
    return path
