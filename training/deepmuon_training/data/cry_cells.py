"""The cells of CRY's tables, inside which its muons are uniform in log E and in cos zenith."""

from __future__ import annotations

import numpy as np

__all__ = ["COS_ZENITH_EDGES", "ENERGY_CELL"]

ENERGY_CELL = 0.2
"""Width of CRY's energy cells, in decades; their edges are the whole multiples of it in log10(E/GeV)."""

COS_ZENITH_EDGES = np.linspace(0.0, 1.0, 21)
"""Edges of CRY's cells in cos zenith."""
