"""CRY's text output, `shower.out` of its program `testOut`.

A line is a particle: event, secondary, particle id, kinetic energy [MeV], x, y, z [m], and the direction of motion u,
v, w, z up. The header forgets the id: 0 neutron, 1 proton, 2 pion, 3 kaon, 4 muon, 5 electron, 6 photon. There is no
charge, and no live time: `testOut` prints "Total time simulated" on the terminal.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.data.foreign.muons import CHARGE_UNKNOWN, foreign_muons
from deepmuon_training.data.foreign.table import Float, Place
from deepmuon_training.data.foreign.text_table import open_text

__all__ = ["CryText", "read_cry_text"]

COLUMNS = 10
MUON, LAST_ID = 4, 6


class CryText(NamedTuple):
    """The muons of CRY's text output.

    Parameters
    ----------
    muons : Muons
        Their pdg_id is 0: CRY does not write the charge.
    particles : int
        Lines, of all kinds of particles.
    count_variance : float
        Variance of the number of muons, in units of Poisson's: <m^2> / <m>, m being the muons of a shower.
    """

    muons: Muons
    particles: int
    count_variance: float


def read_cry_text(path: str | Path) -> CryText:
    """Read the muons of CRY's text output, in pieces.

    The memory needed grows with the number of muons, 50 bytes each, and not with the size of the file.

    Raises
    ------
    RefusedError
        If the file can't be read, was cut off, has a line that is not CRY's, or no muon.
    """
    parts, events, particles = [], [], 0
    for place, numbers in open_text(path, COLUMNS, ends_with_newline=True).rows(range(COLUMNS)):
        _refuse_other_lines(place, numbers)
        rows = np.flatnonzero(numbers[:, 2] == MUON)
        parts.append(_muons(place, rows, numbers[rows]))
        events.append(numbers[rows, 0])
        particles += len(numbers)
    muons = Muons.concatenate(parts)
    if not len(muons):
        raise RefusedError(f"{path} has {particles:,} particles, and no muon among them")
    return CryText(muons, particles, _count_variance(np.concatenate(events)))


def _refuse_other_lines(place: Place, numbers: Float) -> None:
    """Refuse ten numbers that do not begin with an event, a secondary and a particle id."""
    whole = numbers[:, :3]
    bad = ~((whole >= 0) & (whole == np.floor(whole))).all(axis=1) | (whole[:, 2] > LAST_ID)
    if bad.any():
        row = int(np.argmax(bad))
        shown = " ".join(f"{number:g}" for number in whole[row])
        raise RefusedError(
            f"{place(row)} is not CRY's: it begins with {shown}, not with an event, a secondary and a "
            f"particle id from 0 to {LAST_ID}"
        )


def _muons(place: Place, rows: NDArray[np.intp], numbers: Float) -> Muons:
    return foreign_muons(1e-3 * numbers[:, 3], numbers[:, 7:], CHARGE_UNKNOWN, lambda index: place(int(rows[index])))


def _count_variance(events: Float) -> float:
    """Return <m^2> / <m>; a shower is consecutive muons of one event, so that several runs may follow each other."""
    starts = np.flatnonzero(np.diff(events, prepend=-1))
    m = np.diff(starts, append=len(events)).astype(np.float64)
    return float(np.mean(m**2) / np.mean(m))
