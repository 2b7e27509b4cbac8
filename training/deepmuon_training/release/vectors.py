"""Test vectors: latents and the muons that a model makes of them, which every engine has to give.

The muons are PyTorch's, in double precision, of the numbers that the file stores
(`deepmuon_training.generators.read_back`): no engine is the judge of another.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from deepmuon_runtime.latents.philox import latents
from deepmuon_training.export.exportable import Exportable
from deepmuon_training.generators.read_back import read_back

__all__ = ["muon_vectors"]

MUONS = 64
"""Muons of random latents, at least; in two draws at least."""

SEED = 5

MARGIN = 2.0**-12
"""No charge changes when the latents move by this much: an engine's rounding does not change it either."""

STEADY = 2.0**-20, 1e-3
"""Nor does a direction change by more than the second number when they move by the first: no other row is read."""


def muon_vectors(model: Path) -> str:
    """Return the test vectors of a model that was exported here, as JSON.

    Random draws, and, where a draw is one muon, every combination of the latents' end points. (Equal sort keys of a
    draw of several muons could be sorted either way.) The object's keys:

    model, sha256
        File name and hash.
    draws, muons
        How many.
    latent
        [draws x latent_size] numbers, row by row, which float32 holds exactly.
    kinetic_energy, charge
        [muons] in GeV; -1 or +1.
    direction
        [muons x 3] row by row.

    Raises
    ------
    RefusedError
        As `read_back`.
    """
    contents = model.read_bytes()
    generator = read_back(contents)
    latent = _random(generator)
    if generator.muons_per_draw == 1:
        latent = np.concatenate([latent, _end_points(generator.latent_size)])
    energy, direction, charge = _muons(generator, latent)
    vectors = {
        "model": model.name,
        "sha256": hashlib.sha256(contents).hexdigest(),
        "draws": len(latent),
        "muons": len(energy),
        "latent": _rounded(latent),
        "kinetic_energy": _rounded(energy),
        "direction": _rounded(direction),
        "charge": charge.tolist(),
    }
    return json.dumps(vectors) + "\n"


def _random(generator: Exportable) -> NDArray[np.float32]:
    """Return random draws of which rounding changes no charge and no row of a table."""
    draws = max(2, -(-MUONS // generator.muons_per_draw))
    latent = latents(seed=SEED, first=0, draws=4 * draws, latent_size=generator.latent_size)
    low, charge, high = (_muons(generator, latent + shift)[2] for shift in (-MARGIN, 0, MARGIN))
    nudge, change = STEADY
    left, here, right = (_muons(generator, latent + np.float64(shift))[1] for shift in (-nudge, 0, nudge))
    still = np.maximum(np.abs(left - here), np.abs(right - here)).max(axis=1) < change
    sure = ((low == charge) & (charge == high) & still).reshape(len(latent), -1).all(axis=1)
    chosen: NDArray[np.float32] = latent[sure][:draws]
    return chosen


def _end_points(size: int) -> NDArray[np.float32]:
    return np.array(list(itertools.product((-1, 1), repeat=size)), dtype=np.float32)


def _muons(generator: Exportable, latent: NDArray[np.float32] | NDArray[np.float64]) -> list[NDArray[np.float64]]:
    with torch.no_grad():
        return [column.numpy() for column in generator(torch.from_numpy(latent).double())]


def _rounded(column: NDArray[np.float32] | NDArray[np.float64]) -> list[float]:
    return [float(f"{number:.9g}") for number in column.ravel()]
