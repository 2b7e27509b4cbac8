"""Writes a trained generator as an ONNX file that keeps the contract, version 1."""

from __future__ import annotations

from dataclasses import dataclass, fields
from importlib.metadata import version
from pathlib import Path
from typing import Protocol

import numpy as np
import onnx
import onnxruntime
import torch
from numpy.typing import NDArray
from onnx import TensorProto

from deepmuon_runtime.errors import FailedError
from deepmuon_runtime.files.output import check_output
from deepmuon_runtime.files.whole import write_whole
from deepmuon_runtime.latents.philox import latents
from deepmuon_runtime.model.metadata import CONTRACT_VERSION, METADATA_PREFIX
from deepmuon_training.energy_transform import LAMBDA
from deepmuon_training.export.graph import Graph
from deepmuon_training.sample import Sample

__all__ = ["Exportable", "Mismatch", "Training", "compare", "export"]

COMPARED_MUONS = 100_000

ROUNDING = 8.0
"""How much farther than PyTorch in float32 the ONNX output may be from PyTorch in float64."""

_LAST_BIT = 2**-23

LICENCE = "BSD-3-Clause"


class Exportable(Protocol):
    """A generator as stored numbers: what an ONNX file holds.

    ``__call__`` evaluates them in PyTorch: latents [draws, latent_size] to kinetic energy [muons] in GeV, direction
    [muons, 3] and charge [muons], in the latents' precision. ``graph`` builds the same in ONNX.
    """

    @property
    def architecture(self) -> str:
        """Its name."""

    @property
    def latent_size(self) -> int:
        """Uniform numbers of a draw."""

    @property
    def muons_per_draw(self) -> int:
        """Muons made of them."""

    @property
    def energy_range(self) -> tuple[float, float]:
        """Lowest and highest kinetic energy [GeV]."""

    @property
    def energy_mean(self) -> float:
        """Mean of the transformed energy in training; for the record."""

    def __call__(self, latent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Evaluate in PyTorch."""

    def graph(self) -> tuple[Graph, str, str, str]:
        """Build the graph; returns it with the names of energy, direction and charge."""


@dataclass(frozen=True)
class Training:
    """What a model was trained on.

    Parameters
    ----------
    depth_m, medium, source, provenance, rate, rate_uncertainty, smoothed
        Of the sample, see `deepmuon_training.sample.Sample`.
    muons
        How many.
    seed
        Of weights and batches.
    """

    depth_m: float
    medium: str
    source: str
    provenance: tuple[str, ...]
    rate: float | None
    rate_uncertainty: float | None
    smoothed: bool | None
    muons: int
    seed: int

    @classmethod
    def of(cls, sample: Sample, seed: int) -> Training:
        """Note what a sample is, without its muons."""
        alike = {f.name: getattr(sample, f.name) for f in fields(cls) if f.name not in ("muons", "seed")}
        return cls(**alike, muons=len(sample), seed=seed)


@dataclass(frozen=True)
class Mismatch:
    """Largest differences over the compared muons: energy relative, direction absolute, and how many charges."""

    energy: float
    direction: float
    charges: int


def export(generator: Exportable, training: Training, path: Path, *, overwrite: bool = False) -> Mismatch:
    """Write an ONNX file, after comparing its output with PyTorch's on 100,000 muons.

    Parameters
    ----------
    generator
        The numbers that it stores.
    training
        Written as its metadata; what is unknown is left out.
    path
        The file.
    overwrite
        Whether an existing file is replaced.

    Returns
    -------
    Mismatch
        Between ONNX Runtime and PyTorch in float64, both on the stored numbers.

    Raises
    ------
    RefusedError
        If the file exists (without `overwrite`) or can't be written.
    FailedError
        If they differ by more than float32 rounding explains; nothing is written.
    """
    check_output(path, overwrite)
    contents = _model(generator, training).SerializeToString(deterministic=True)
    mismatch = compare(generator, contents)
    write_whole(path, contents, overwrite=overwrite)
    return mismatch


def compare(generator: Exportable, contents: bytes) -> Mismatch:
    """Compare an ONNX model with PyTorch's evaluation of the same stored numbers.

    The yardstick is PyTorch itself, float32 against float64. Where a direction depends so much on the last bit of a
    latent that this says little (an azimuth that few muons have), it is what a change of that bit makes, muon by muon.

    Raises
    ------
    FailedError
        If ONNX Runtime is over `ROUNDING` times farther from float64 than PyTorch in float32, or more charges
        differ than ten, and ten for each that differs in PyTorch: random numbers within rounding of their threshold.
    """
    latent = _latents(generator)
    session = onnxruntime.InferenceSession(contents, providers=["CPUExecutionProvider"])
    found = session.run(["kinetic_energy", "direction", "charge"], {"latent": latent})
    with torch.no_grad():
        single = [part.numpy() for part in generator(torch.from_numpy(latent))]
        exact = [part.numpy() for part in generator(torch.from_numpy(latent).double())]
        nudged = generator(torch.from_numpy(latent).double() * (1 - _LAST_BIT))[1].numpy()
    allowed, seen = _mismatch(single, exact), _mismatch(found, exact)
    limit = Mismatch(
        ROUNDING * max(allowed.energy, _LAST_BIT),
        ROUNDING * max(allowed.direction, _LAST_BIT),
        10 + 10 * allowed.charges,
    )
    direction = float((np.abs(found[1] - exact[1]) - ROUNDING * np.abs(nudged - exact[1])).max())
    agree = seen.energy <= limit.energy and direction <= limit.direction and seen.charges <= limit.charges
    if not agree:  # nor where one is no number
        raise FailedError(f"ONNX Runtime and PyTorch differ by {seen}, float32 rounding explains {limit}")
    return seen


def _latents(generator: Exportable) -> NDArray[np.float32]:
    """Latents for the compared muons, among them draws at the end points."""
    draws = -(-COMPARED_MUONS // generator.muons_per_draw)
    latent = latents(seed=0, first=0, draws=draws, latent_size=generator.latent_size)
    latent[0], latent[1] = -1, 1
    return latent


def _mismatch(found: list[NDArray[np.generic]], exact: list[NDArray[np.generic]]) -> Mismatch:
    return Mismatch(
        float(np.abs(found[0] / exact[0] - 1).max()),  # type: ignore[operator]
        float(np.abs(found[1] - exact[1]).max()),  # type: ignore[operator]
        int(np.sum(found[2] != exact[2])),
    )


def _model(generator: Exportable, training: Training) -> onnx.ModelProto:
    graph, energy, direction, charge = generator.graph()
    return graph.model(
        {"latent": ["draws", generator.latent_size]},
        {
            "kinetic_energy": (energy, TensorProto.FLOAT, ["muons"]),
            "direction": (direction, TensorProto.FLOAT, ["muons", 3]),
            "charge": (charge, TensorProto.INT8, ["muons"]),
        },
        {METADATA_PREFIX + key: value for key, value in _metadata(generator, training).items()},
    )


def _metadata(generator: Exportable, training: Training) -> dict[str, str]:
    """Return the model's metadata; what is unknown is left out."""
    known = {
        "contract_version": CONTRACT_VERSION,
        "architecture": generator.architecture,
        "depth_m": f"{training.depth_m:g}",
        "medium": training.medium,
        "muons_per_draw": generator.muons_per_draw,
        "latent_size": generator.latent_size,
        "energy_min_gev": generator.energy_range[0],  # all digits: a muon that the graph clips is within
        "energy_max_gev": generator.energy_range[1],
        "created_by": f"deepmuon-training {version('deepmuon-training')}",
        "licence": LICENCE,
        "rate_hz_per_m2": None if training.rate is None else f"{training.rate:.6g}",
        "rate_uncertainty_hz_per_m2": None if training.rate_uncertainty is None else f"{training.rate_uncertainty:.3g}",
        "boxcox_lambda": LAMBDA,
        "energy_mean": f"{generator.energy_mean:.9g}",
        "training_source": training.source,
        "training_smoothed": None if training.smoothed is None else str(training.smoothed).lower(),
        "training_muons": training.muons,
        "training_seed": training.seed,
    }
    return {key: str(value) for key, value in known.items() if value is not None}
