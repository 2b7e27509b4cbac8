"""Muons of a file counted by energy and by zenith angle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.reader import read_attributes, read_pieces
from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY

__all__ = ["ENERGY_EDGES", "ZENITH_EDGES", "Spectra", "count_spectra"]

PIECE = 1 << 17  # muons read at once

ENERGY_EDGES = np.geomspace(LOWEST_ENERGY, HIGHEST_ENERGY, 81)
"""Edges of the bins in kinetic energy [GeV], ten to a decade."""

ZENITH_EDGES = np.linspace(0, 90, 46)
"""Edges of the bins in zenith angle [degrees]."""


@dataclass(frozen=True)
class Spectra:
    """The muons of a file.

    Parameters
    ----------
    name : str
        The file's.
    depth_m : float
        Metres of water, or of what else is above.
    count : int
        How many muons.
    rate : float or None
        Their rate in 1/(m2 s), where it is known.
    by_energy, by_zenith : int64 [bins]
        Muons in the bins of `ENERGY_EDGES` and `ZENITH_EDGES`.
    """

    name: str
    depth_m: float
    count: int
    rate: float | None
    by_energy: NDArray[np.int64]
    by_zenith: NDArray[np.int64]


def count_spectra(path: str | Path, *, progress: Callable[[int], object] | None = None) -> Spectra:
    """Count the muons of a file.

    Parameters
    ----------
    path
        A muon file. The memory needed does not grow with its size.
    progress
        Called after each piece with the number of muons read since the last call.

    Raises
    ------
    RefusedError
        If it can't be read, is no muon file or a damaged one, or holds no muon.
    """
    attributes = read_attributes(path)
    count = int(attributes["count"])
    if not count:
        raise RefusedError(f"{path} holds no muon")
    by_energy, by_zenith = np.zeros(len(ENERGY_EDGES) - 1, np.int64), np.zeros(len(ZENITH_EDGES) - 1, np.int64)
    for muons in read_pieces(path, PIECE):
        by_energy += np.histogram(muons.kinetic_energy, ENERGY_EDGES)[0]
        by_zenith += np.histogram(np.degrees(np.arccos(np.clip(muons.cos_zenith, -1, 1))), ZENITH_EDGES)[0]
        if progress is not None:
            progress(len(muons))
    rate = attributes.get("rate_hz_per_m2")
    return Spectra(Path(path).name, float(attributes["depth_m"]), count, rate, by_energy, by_zenith)
