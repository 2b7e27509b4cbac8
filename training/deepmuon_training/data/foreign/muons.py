"""Numbers that another program wrote as muons, refused where they can't be."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS, Muons
from deepmuon_runtime.physical import NOT_NEGATIVE_ENERGIES, Fault, first_unphysical
from deepmuon_training.data.foreign.table import Place

__all__ = ["CHARGE_UNKNOWN", "foreign_muons", "pdg_id_of", "refuse_unphysical"]

CHARGE_UNKNOWN = 0
"""In place of a muon's pdg_id, until its charge is stated (`deepmuon_training.data.conversion.draw_charges`)."""

FEW_DIGITS = 0.01
"""How far the length of a direction of three digits may be from 1."""


def foreign_muons(
    kinetic_energy: ArrayLike, direction: ArrayLike, pdg_id: ArrayLike, place: Place, *, hint: str = ""
) -> Muons:
    """Make muons of another program's numbers, with directions of length 1.

    Parameters
    ----------
    kinetic_energy : array_like [n]
        Kinetic energy in GeV.
    direction : array_like [n, 3]
        Direction of motion, z up; its length may be wrong by 1 %, as three digits make it.
    pdg_id : array_like [n], or one for all
        13, -13, or 0 where the charge is unknown.
    place
        Where each stands, for an error.
    hint
        What to do where they go up.

    Raises
    ------
    RefusedError
        As `refuse_unphysical`.
    """
    u, v, w = vectors = np.asarray(direction, dtype=np.float64).T
    pdg_ids = np.broadcast_to(pdg_id, len(w))
    with np.errstate(over="ignore"):  # beyond float32: infinite, which is refused
        refuse_unphysical(Muons.of(kinetic_energy, u, v, w, pdg_ids), place, tolerance=FEW_DIGITS, hint=hint)
    u, v, w = vectors / np.linalg.norm(vectors, axis=0)
    return Muons.of(kinetic_energy, u, v, w, pdg_ids)


def refuse_unphysical(muons: Muons, place: Place, *, tolerance: float, hint: str = "") -> None:
    """Raise an error that names the first muon that can't be.

    Parameters
    ----------
    muons, place, hint
        As for `foreign_muons`.
    tolerance
        How far the length of a direction may be from 1.

    Raises
    ------
    RefusedError
        If a kinetic energy is negative or not finite, or a direction has not length 1 or does not go down.
    """
    bad = first_unphysical(muons, *NOT_NEGATIVE_ENERGIES, length_tolerance=tolerance, charge_known=False)
    if bad is not None:
        advice = f": {hint}" if hint and bad[1].startswith(Fault.UPWARD.value) else ""
        raise RefusedError(f"{place(bad[0])}: the muon {bad[1]}{advice}")


def pdg_id_of(charge: NDArray[np.generic], place: Place) -> NDArray[np.int8]:
    """Return the muon's particle number for each charge.

    Parameters
    ----------
    charge : array [n]
        Charge in e.
    place
        As for `foreign_muons`.

    Raises
    ------
    RefusedError
        If one is neither -1 nor +1.
    """
    bad = ~np.isin(charge, (-1, 1))
    if bad.any():
        index = int(np.argmax(bad))
        raise RefusedError(f"{place(index)}: the muon has the charge {charge[index]}, which is neither -1 nor +1")
    return np.where(charge == 1, MU_PLUS, MU_MINUS).astype(np.int8)
