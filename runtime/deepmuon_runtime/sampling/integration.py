"""What cuts and a target keep of a model's muons: an integral over its latents at fixed points, the same in each run.

The points of a Kronecker sequence lie more evenly than random ones: the error falls nearly with their number, not
with its root. Eight of them, each shifted otherwise, say how large it is. Source of the steps: M. Roberts, "The
Unreasonable Effectiveness of Quasirandom Sequences" (2018),
https://extremelearning.com.au/unreasonable-effectiveness-of-quasirandom-sequences/
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.cuts import Cuts
from deepmuon_runtime.latents.philox import FOR_LATENTS, FOR_POSITIONS, fill_latents
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.sampling.drawing import NUMBERS_OF_PLACE
from deepmuon_runtime.sampling.energy_cut import EnergyCut
from deepmuon_runtime.sampling.source import Source, block_draws
from deepmuon_runtime.targets.target import Target

__all__ = ["Integral", "integral"]

SHIFTS = 8
POINTS = 1 << 14  # muons of a shift at once, about
FEWEST, MOST = 1 << 19, 1 << 24  # muons
PRECISION = {True: 3e-4, False: 3e-3}  # relative, from which on no more muons are asked, of even points and random ones
FEW_LATENTS = 8  # to which even points are even
STREAM = 0x696E_7465_6772_616C  # of random points: no model has it but by chance


@dataclass(frozen=True)
class Integral:
    """A mean over muons.

    Parameters
    ----------
    mean
        Of the area by which they are multiplied [m2], 1 without a target, and 0 of those that are cut away.
    error
        Its standard uncertainty.
    muons
        How many were looked at.
    """

    mean: float
    error: float
    muons: int


def integral(
    source: Source, cuts: Cuts, target: Target | None, energy: EnergyCut | None, stopped: Callable[[], object]
) -> Integral:
    """Return the mean area of the muons that cuts keep.

    Parameters
    ----------
    source, cuts, target
        What is asked.
    energy
        Where it is given, all muons are of its energies already.
    stopped
        Called now and then; it may raise.
    """
    model = source.model
    is_even = model.muons_per_draw == 1 and model.latent_size <= FEW_LATENTS
    rows = block_draws(model, POINTS)  # on every device the same points: the times of a live time go by the rate
    sums = np.zeros(SHIFTS)
    done = 0  # draws of each shift
    made = Muons.empty(rows * model.muons_per_draw)
    while True:
        for shift in range(SHIFTS):
            stopped()
            points = _even_points if is_even else _random_points
            latent, numbers = points(shift, done, rows, model.latent_size, model.muons_per_draw)
            if energy is not None:
                energy.squeeze(latent)
            source.run(latent, made)
            if energy is not None:
                energy.clamp(made)
            source.check(made, 0)
            area = 1.0 if target is None else target.exposure(made.u, made.v, made.w, numbers)
            sums[shift] += float((area * cuts.keeps(made)).sum())
        done += rows
        muons = SHIFTS * done * model.muons_per_draw
        means = sums / (done * model.muons_per_draw)
        mean, error = float(means.mean()), float(means.std(ddof=1) / math.sqrt(SHIFTS))
        if muons >= MOST or (muons >= FEWEST and mean > 0 and error <= PRECISION[is_even] * mean):
            return Integral(mean, error, muons)


def _even_points(
    shift: int, first: int, draws: int, latent_size: int, muons_per_draw: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the next points of a shifted sequence: latents [draws, latent_size], and numbers for places [draws, 3]."""
    size = latent_size + NUMBERS_OF_PLACE
    steps = _root(size) ** -np.arange(1.0, size + 1)
    starts = np.random.Philox(key=STREAM, counter=shift << 64).random_raw(size) * 2.0**-64
    points = starts + np.arange(first, first + draws)[:, None] * steps
    points -= np.floor(points)
    both = np.clip(2 * points - 1, -1 + 2.0**-24, 1 - 2.0**-24).astype(np.float32)
    return both[:, :latent_size], both[:, latent_size:]


def _root(size: int) -> float:
    """Return the number above 1 whose power of size + 1 is 1 more than itself: 1.618 for 1."""
    root = 2.0
    for _ in range(64):
        root = (1 + root) ** (1 / (size + 1))
    return root


def _random_points(
    shift: int, first: int, draws: int, latent_size: int, muons_per_draw: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the same of random points."""
    latent = np.empty((draws, latent_size), np.float32)
    numbers = np.empty((draws * muons_per_draw, NUMBERS_OF_PLACE), np.float32)
    fill_latents(latent, shift, first, STREAM, purpose=FOR_LATENTS)
    fill_latents(numbers, shift, first * muons_per_draw, STREAM, purpose=FOR_POSITIONS)
    return latent, numbers
