"""Writes a trained generator as an ONNX file that keeps the contract, version 2."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

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
from deepmuon_runtime.model.metadata import METADATA_PREFIX
from deepmuon_training.export.exportable import Exportable
from deepmuon_training.export.graph import RATE, Graph
from deepmuon_training.export.metadata import Training, metadata

__all__ = ["Mismatch", "as_model", "compare", "export"]

COMPARED_MUONS = 100_000

ROUNDING = 8.0
"""How much farther than PyTorch in float32 the ONNX output may be from PyTorch in float64."""

_LAST_BIT = 2**-23

_NUDGE = 4 * _LAST_BIT
"""What a few roundings change of a latent."""

_STEP = 2e-5
"""Where a nudge of the latents changes a direction by more than this, it is the nudge that it is compared with."""


@dataclass(frozen=True)
class Mismatch:
    """Largest differences over the compared muons: energy relative, direction absolute, and how many charges.

    A direction may depend on the last bits of a latent: where few muons come from, or where they decide which of two
    cells of a table is read. Of those muons only what a nudge of the latents does not explain is counted.
    """

    energy: float
    direction: float
    charges: int

    @property
    def note(self) -> str:
        """Say it in a sentence."""
        return (
            f"ONNX Runtime differs from PyTorch in double precision by at most {self.energy:.1e} of the energy and "
            f"{self.direction:.1e} of a direction, on 100,000 muons."
        )


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

    The yardstick is PyTorch itself, float32 against float64.

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
        nudged = [generator(torch.from_numpy(latent).double() + x)[1].numpy() for x in (-_NUDGE, _NUDGE)]
    explained = np.maximum(*(np.abs(direction - exact[1]) for direction in nudged))
    explained[explained < _STEP] = 0
    allowed, seen = (_mismatch(muons, exact, explained) for muons in (single, found))
    limit = Mismatch(
        ROUNDING * max(allowed.energy, _LAST_BIT),
        ROUNDING * max(allowed.direction, _LAST_BIT),
        10 + 10 * allowed.charges,
    )
    agree = seen.energy <= limit.energy and seen.direction <= limit.direction and seen.charges <= limit.charges
    if not agree:  # nor where one is no number
        raise FailedError(f"ONNX Runtime and PyTorch differ by {seen}, float32 rounding explains {limit}")
    return seen


def _latents(generator: Exportable) -> NDArray[np.float32]:
    """Latents for the compared muons, among them draws at the end points."""
    draws = -(-COMPARED_MUONS // generator.muons_per_draw)
    latent = latents(seed=0, first=0, draws=draws, latent_size=generator.latent_size)
    latent[0], latent[1] = -1, 1
    return latent


def _mismatch(
    found: list[NDArray[np.generic]], exact: list[NDArray[np.generic]], explained: NDArray[np.float64]
) -> Mismatch:
    return Mismatch(
        float(np.abs(found[0] / exact[0] - 1).max()),  # type: ignore[operator]
        max(float((np.abs(found[1] - exact[1]) - explained).max()), 0.0),  # type: ignore[operator]
        int(np.sum(found[2] != exact[2])),
    )


def _model(generator: Exportable, training: Training) -> onnx.ModelProto:
    graph, *muons = generator.graph()
    rate = None
    if training.rate is not None:
        rate = graph.constant(np.array([training.rate], dtype=np.float32), RATE)
    return as_model(graph, muons, rate, generator.latent_size, metadata(generator, training))


def as_model(
    graph: Graph, muons: Sequence[str], rate: str | None, latent_size: int, described: dict[str, str]
) -> onnx.ModelProto:
    """Finish a graph with the contract's input, outputs and metadata.

    Parameters
    ----------
    graph
        With a node or constant for each output.
    muons
        Names of kinetic energy, direction and charge.
    rate
        Name of the rate, or None where it is unknown.
    latent_size
        Of a draw.
    described
        The metadata, without its prefix.
    """
    energy, direction, charge = muons
    outputs: dict[str, tuple[str, int, list[str | int]]] = {
        "kinetic_energy": (energy, TensorProto.FLOAT, ["muons"]),
        "direction": (direction, TensorProto.FLOAT, ["muons", 3]),
        "charge": (charge, TensorProto.INT8, ["muons"]),
    }
    if rate is not None:
        outputs["rate_hz_per_m2"] = (rate, TensorProto.FLOAT, [1])
    named = {METADATA_PREFIX + key: value for key, value in described.items()}
    return graph.model({"latent": ["draws", latent_size]}, outputs, named)
