"""Muons as text, one a line, for programs that read no HDF5."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.latents.philox import FOR_POSITIONS, words
from deepmuon_runtime.muon_file.format import FORMAT
from deepmuon_runtime.muon_file.reader import read_attributes, read_pieces
from deepmuon_runtime.muons import Muons

__all__ = ["SHORTEST_LINE", "UNITS", "csv_pieces", "phits_pieces"]

UNITS = {"GeV": 1.0, "MeV": 1e3}
"""Each unit of energy in a GeV."""

PIECE = 1 << 15  # muons turned into text at once

SHORTEST_LINE = len("1,0,0,-1,13\n")
"""Bytes that a muon takes at least."""

LINE = "%.9g,%.9g,%.9g,%.9g,%d\n"  # nine digits tell any two float32 numbers apart


def csv_pieces(path: str | Path, *, unit: str = "GeV", header: bool = True) -> Iterator[str]:
    """Read a muon file as comma-separated text, in pieces of whole lines.

    A line holds kinetic energy, u, v, w and pdg_id; read as float32 numbers, and in GeV, they are those of the file.
    What the file says of its muons stands above them as comments: # name = value, the value in JSON.

    Parameters
    ----------
    path
        A muon file. The memory needed does not grow with its size.
    unit
        Unit of the energy, one of `UNITS`.
    header
        Whether comments come first, and a line that names the columns: kinetic_energy_GeV,u,v,w,pdg_id.

    Raises
    ------
    RefusedError
        If the file can't be read or is no muon file, or there is no such unit; after the last piece, if its muons are
        not what was written: text that is shown to somebody before the end is not verified.
    """
    if unit not in UNITS:
        raise RefusedError(f"there is no unit {unit!r}: energies are in {' or '.join(UNITS)}")
    pieces = read_pieces(path, PIECE)
    first = next(pieces, Muons.empty(0))
    if header:
        said = {"format": FORMAT, **read_attributes(path)}
        yield "".join(f"# {name} = {json.dumps(value)}\n" for name, value in said.items())
        yield f"kinetic_energy_{unit},u,v,w,pdg_id\n"
    for muons in chain([first], pieces):
        yield _lines(muons, UNITS[unit])


def _lines(muons: Muons, factor: float) -> str:
    energy = muons.kinetic_energy.astype(np.float64) * factor
    rows = np.stack([energy, muons.u, muons.v, muons.w, muons.pdg_id], axis=1)
    return LINE * len(muons) % tuple(rows.ravel().tolist())


PHITS_LINE = "%d %.9g %.9g 0 %.17g %.17g %.17g %.9g 1 0\n"


def phits_pieces(path: str | Path, *, side: float, seed: int) -> Iterator[str]:
    """Read a muon file as a list of particles for PHITS (`s-type = 17`), in pieces of whole lines.

    A line holds the particle's code, x, y and z [cm], u, v, w, kinetic energy [MeV], weight 1 and time 0. The places
    are uniform on a horizontal square around the origin. Directions are of length 1 in double precision.

    Parameters
    ----------
    path
        A muon file, format version 1. The memory needed does not grow with its size.
    side
        Metres, of the square.
    seed
        0 to 2^64 - 1, of the places.

    Raises
    ------
    RefusedError
        If the file can't be read or is no muon file.
    """
    first = 0
    for muons in read_pieces(path, PIECE):
        uniform = (words(seed, 0, FOR_POSITIONS, 2 * first, 2 * len(muons)) >> np.uint64(12)) * 2.0**-52 + 2.0**-53
        x, y = 100 * side * (uniform.reshape(-1, 2).T - 0.5)
        direction = np.stack([muons.u, muons.v, muons.w]).astype(np.float64)
        direction /= np.linalg.norm(direction, axis=0)
        energy = muons.kinetic_energy.astype(np.float64) * UNITS["MeV"]
        rows = np.stack([muons.pdg_id, x, y, *direction, energy], axis=1)
        yield PHITS_LINE * len(muons) % tuple(rows.ravel().tolist())
        first += len(muons)
