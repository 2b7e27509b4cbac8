"""MCPL files, which the package `mcpl` reads but does not write."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

__all__ = ["mcpl_file"]


def mcpl_file(
    pdg_id: Sequence[int], energy: Sequence[float], direction: Sequence[Sequence[float]], weight: Sequence[float]
) -> bytes:
    """An MCPL file of version 3 in double precision, of particles with energies [MeV] and |w| above |u| and |v|."""
    header = struct.pack("<8sQ5Ii2II", b"MCPL003L", len(energy), 0, 0, 0, 0, 0, 0, 8 * 8 + 4, 0, 0)
    rows = [
        struct.pack("<8di", 0, 0, 0, u, v, np.copysign(kinetic, w), 0, one, code)
        for code, kinetic, (u, v, w), one in zip(pdg_id, energy, direction, weight, strict=True)
    ]
    return header + b"".join(rows)
