"""Energies between two bounds without rejection, where the energy rises with known latents."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.cuts import Cuts
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.sampling.source import Source

__all__ = ["EnergyCut"]

FINE_STEP = 2.0**-24
"""The second latent of the energy counts in these units."""

LARGEST = np.float32(1 - FINE_STEP)  # the end of the first
SMALLEST_SHARE = 2.0**-40
"""Of all muons: the two latents have 2^48 values, and energies should not show them."""

SECTIONS = 1024  # into which an interval is cut at once


class EnergyCut:
    """The part of the energy's latents that gives energies within bounds.

    The energy rises with the level y = l_c - sign(l_c) 2^-24 l_f, uniform from -1 to 1: the metadata's `energy_latents`
    are c and f. Bounds of the energy are bounds of y, which are found by cutting [-1, 1] again and again. Drawn levels
    are then squeezed between them.

    Parameters
    ----------
    source
        A model with such latents.
    cuts
        Their energies are the bounds.

    Attributes
    ----------
    share : float
        Of all muons, between the bounds.

    Raises
    ------
    RefusedError
        If there are none.
    """

    def __init__(self, source: Source, cuts: Cuts) -> None:
        assert source.model.energy_latents is not None
        self._coarse, self._fine = source.model.energy_latents
        self._least, self._most = cuts.energies
        low = self._level(source, self._least) if cuts.energy_min is not None else -1.0
        high = self._level(source, np.nextafter(self._most, np.float32(np.inf))) if cuts.energy_max is not None else 1.0
        self._middle, self._half = (low + high) / 2, (high - low) / 2
        self.share = self._half
        if not self.share > SMALLEST_SHARE:
            raise RefusedError(
                f"{source.model.name} has no muon, or less than one in a million million, of a kinetic energy from "
                f"{self._least:g} to {self._most:g} GeV"
            )

    def squeeze(self, latent: NDArray[np.float32]) -> None:
        """Move the latents of the energy, float32 [n, latent_size], to where it is within the bounds."""
        level = _level(latent[:, self._coarse], latent[:, self._fine])
        level *= self._half
        level += self._middle
        latent[:, self._coarse], latent[:, self._fine] = _latents(level)

    def clamp(self, muons: Muons) -> None:
        """Undo what the roundings of float32 do to energies at the bounds."""
        np.clip(muons.kinetic_energy, self._least, self._most, out=muons.kinetic_energy)

    def _level(self, source: Source, energy: np.float32) -> float:
        """Return the lowest level with at least some energy; 1 where there is none."""
        low, high = -1.0, 1.0
        latent = np.zeros((SECTIONS + 1, source.model.latent_size), np.float32)
        muons = Muons.empty(SECTIONS + 1)
        while True:
            levels = np.linspace(low, high, SECTIONS + 1)
            latent[:, self._coarse], latent[:, self._fine] = _latents(levels)
            source.run(latent, muons)
            reached = np.append(muons.kinetic_energy >= energy, True)
            first = int(np.argmax(reached))
            if first == 0 or first > SECTIONS:
                return low if first == 0 else high
            low, high = float(levels[first - 1]), float(levels[first])
            if high - low <= math.ulp(max(abs(low), abs(high))) * 2:
                return high


def _level(coarse: NDArray[np.float32], fine: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the level of two latents."""
    step = fine * np.copysign(np.float32(FINE_STEP), coarse)  # exact: a power of 2
    return np.subtract(coarse, step, dtype=np.float64)


def _latents(level: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the two latents of a level: the nearest float32, and what is left."""
    coarse = np.clip(level.astype(np.float32), -LARGEST, LARGEST)
    fine = (coarse - level).astype(np.float32)
    fine *= np.copysign(np.float32(1 / FINE_STEP), coarse)
    return coarse, fine
