"""Which particles are muons, by the numbers that programs give them."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import MU_MINUS, MU_PLUS
from deepmuon_training.data.foreign.table import Float, Place

__all__ = ["MUON_IDS", "count_others", "muon_ids", "refuse_others"]

MUON_IDS = {
    "pdg_id": (MU_MINUS, MU_PLUS),
    "corsika_id": (6, 5),
    "musun_id": (11, 10),
    "phits_id": (7, 6),
}
"""Numbers of mu- and mu+.

pdg_id is also what PHITS writes as kf, and phits_id its ityp; corsika_id is that of Geant3, and musun_id that of FLUKA.
"""


def refuse_others(kind: str, ids: Float, place: Place) -> None:
    """Raise an error that names the first particle that is no muon.

    Parameters
    ----------
    kind
        One of `MUON_IDS`.
    ids : float64 [n]
        Numbers of particles.
    place
        Where each stands.

    Raises
    ------
    RefusedError
        If there is one.
    """
    bad = ~np.isin(ids, MUON_IDS[kind])
    if bad.any():
        index = int(np.argmax(bad))
        minus, plus = MUON_IDS[kind]
        raise RefusedError(
            f"{place(index)}: {kind} {ids[index]:g} is no muon (mu- is {minus}, mu+ {plus}): "
            "--muons-only leaves other particles out"
        )


def count_others(kind: str, ids: Float) -> Counter[str]:
    """Count the particles that are no muons, by their numbers; arguments are those of `refuse_others`."""
    numbers, counts = np.unique(ids[~np.isin(ids, MUON_IDS[kind])], return_counts=True)
    return Counter({f"{number:g}": int(count) for number, count in zip(numbers, counts, strict=True)})


def muon_ids(kind: str, ids: Float) -> NDArray[np.int8]:
    """Return 13 or -13 for each muon; arguments are those of `refuse_others`, of muons alone."""
    return np.where(ids == MUON_IDS[kind][0], MU_MINUS, MU_PLUS).astype(np.int8)
