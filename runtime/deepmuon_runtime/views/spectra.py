"""Muons of a file counted by energy and by zenith angle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import SPHERE
from deepmuon_runtime.muon_file.reader import read_attributes, read_pieces
from deepmuon_runtime.physical import HIGHEST_ENERGY, LOWEST_ENERGY

__all__ = ["COS_ZENITH_EDGES", "ENERGY_EDGES", "Spectra", "count_spectra"]

PIECE = 1 << 17  # muons read at once

ENERGY_EDGES = np.geomspace(LOWEST_ENERGY, HIGHEST_ENERGY, 81)
"""Edges of the bins in kinetic energy [GeV], ten to a decade."""

COS_ZENITH_EDGES = np.linspace(0, 1, 21)
"""Edges of the bins in the cosine of the zenith angle."""


@dataclass(frozen=True)
class Spectra:
    """The muons of a file.

    Parameters
    ----------
    name : str
        The file's.
    depth_m, medium : float, str
        Metres of what lies above.
    flux : str or None
        That at sea level, by its name, where it is known.
    count : int
        How many muons.
    rate : float or None
        Their rate in 1/(m2 s), where it is known.
    by_energy, by_cos_zenith : int64 [bins]
        Muons in the bins of `ENERGY_EDGES` and `COS_ZENITH_EDGES`.
    """

    name: str
    depth_m: float
    medium: str
    flux: str | None
    count: int
    rate: float | None
    by_energy: NDArray[np.int64]
    by_cos_zenith: NDArray[np.int64]


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
    by_energy, by_cos_zenith = (np.zeros(len(edges) - 1, np.int64) for edges in (ENERGY_EDGES, COS_ZENITH_EDGES))
    for muons in read_pieces(path, PIECE):
        by_energy += np.histogram(muons.kinetic_energy, ENERGY_EDGES)[0]
        by_cos_zenith += np.histogram(np.clip(muons.cos_zenith, 0, 1), COS_ZENITH_EDGES)[0]
        if progress is not None:
            progress(len(muons))
    return Spectra(
        name=Path(path).name,
        depth_m=float(attributes["depth_m"]),
        medium=str(attributes["medium"]),
        flux=attributes.get("flux"),
        count=count,
        # That of a sphere's muons is none of a horizontal plane's m2.
        rate=None if attributes.get("surface") == SPHERE else attributes.get("rate_hz_per_m2"),
        by_energy=by_energy,
        by_cos_zenith=by_cos_zenith,
    )
