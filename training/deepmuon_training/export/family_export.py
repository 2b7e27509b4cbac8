"""Writes a family of generators as an ONNX file that keeps the contract, and compares it at several depths."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import onnxruntime

from deepmuon_runtime.errors import FailedError
from deepmuon_runtime.files.output import check_output
from deepmuon_runtime.files.whole import write_whole
from deepmuon_runtime.model.family import at_depth
from deepmuon_training.export.exportable import Family
from deepmuon_training.export.metadata import Training, family_metadata
from deepmuon_training.export.onnx_export import Mismatch, as_model, compare

__all__ = ["export_family"]

_LARGEST_RATE_ERROR = 1e-5
"""Relative, of the rate: what float32 explains of a logarithm of up to some twenty."""


def export_family(
    family: Family,
    knots: Sequence[Training],
    rate_relative_uncertainty: float | None,
    path: Path,
    *,
    overwrite: bool = False,
) -> Mismatch:
    """Write an ONNX file, after comparing its muons with PyTorch's at the ends, in the middle, and between knots.

    Parameters
    ----------
    family
        The numbers that it stores.
    knots
        What each was trained on, in order; its metadata is what they have in common.
    rate_relative_uncertainty
        A bound of that of any depth; None where unknown.
    path, overwrite
        As for `deepmuon_training.export.onnx_export.export`.

    Returns
    -------
    Mismatch
        The largest of any depth between ONNX Runtime and PyTorch in float64, both on the stored numbers.

    Raises
    ------
    RefusedError, FailedError
        As for `deepmuon_training.export.onnx_export.export`; also if the rate is another.
    """
    check_output(path, overwrite)
    graph, energy, direction, charge, rate = family.graph()
    described = family_metadata(family, knots, rate_relative_uncertainty)
    model = as_model(graph, (energy, direction, charge), rate, family.latent_size, described)
    contents = model.SerializeToString(deterministic=True)
    found = [_compare(family, contents, depth, surface) for depth, surface in _places(family)]
    write_whole(path, contents, overwrite=overwrite)
    return Mismatch(*(max(getattr(one, name) for one in found) for name in ("energy", "direction", "charges")))


def _places(family: Family) -> product[tuple[float, int]]:
    """Return knots and depths between them, on all surfaces."""
    depths = family.depths
    middle = len(depths) // 2
    between = [(depths[k] + depths[k + 1]) / 2 for k in {0, middle - 1, len(depths) - 2}]
    return product(sorted({depths[0], depths[middle], depths[-1], *between}), family.surfaces)


def _compare(family: Family, contents: bytes, depth: float, surface: int) -> Mismatch:
    depth = float(np.float32(depth))
    placed, right = at_depth(contents, depth, surface), family.rate(depth, surface)
    if right is not None:
        session = onnxruntime.InferenceSession(placed, providers=["CPUExecutionProvider"])
        latent = np.zeros((1, family.latent_size), dtype=np.float32)
        (rate,) = session.run(["rate_hz_per_m2"], {"latent": latent})[0]
        if not abs(rate / right - 1) <= _LARGEST_RATE_ERROR:
            raise FailedError(f"ONNX Runtime has a rate of {rate} at {depth:g} m, and should have {right}")
    return compare(family.at(depth, surface), placed)
