"""Muons of pions and kaons that decay before they interact: what the formulas of Gaisser's kind have in common.

T. K. Gaisser, Cosmic Rays and Particle Physics, Cambridge 1990; Review of Particle Physics, section "Cosmic rays".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["kaon_part", "pion_part"]

PION_ENERGY, KAON_ENERGY = 115.0, 850.0
"""Energies [GeV] at which a vertical pion or kaon decays as often as it interacts."""

KAON_SHARE = 0.054
"""Muons of kaons for each one of pions, at low energies."""

_ABOVE = 1.1
"""How much less of the parent's energy the muon has, in the parents' decay factor."""

Float = NDArray[np.float64]


def pion_part(energy: Float, cosine: Float) -> Float:
    """Muons of pions, relative to what they would be if every pion decayed.

    Parameters
    ----------
    energy
        The muon's total energy at birth [GeV].
    cosine
        Of its zenith angle there: a slanting pion has more thin air to decay in.
    """
    return 1 / (1 + _ABOVE * energy * cosine / PION_ENERGY)


def kaon_part(energy: Float, cosine: Float) -> Float:
    """Muons of kaons, relative to those of pions if every pion decayed; the parameters are those of `pion_part`."""
    return KAON_SHARE / (1 + _ABOVE * energy * cosine / KAON_ENERGY)
