"""The flux of Guan, Chu, Cao, Luk and Yang, as published: Gaisser's formula with a curved Earth and fewer slow muons.

M. Guan et al., "A parametrization of the cosmic-ray muon flux at sea-level", arXiv:1509.06176. It is
mulder's default.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deepmuon_training.fluxes.flux import CHARGE_RATIO, MUON_MASS, Flux, of_one_charge_ratio
from deepmuon_training.fluxes.pions_and_kaons import kaon_part, pion_part

__all__ = ["gccly", "intensity", "production_cosine"]

_COSINE = (0.102573, -0.068287, 0.958633, 0.0407253, 0.817285)

Float = NDArray[np.float64]


def production_cosine(cos_zenith: Float) -> Float:
    """Cosine of the zenith angle where the muon was born, of which the Earth's curvature makes more than at the ground.

    D. Chirkin, hep-ph/0407078: 0.103 for horizontal muons, 1 for vertical ones.
    """
    p1, p2, p3, p4, p5 = _COSINE
    square = cos_zenith**2 + p1**2 + p2 * cos_zenith**p3 + p4 * cos_zenith**p5
    return np.sqrt(square / (1 + p1**2 + p2 + p4))


def intensity(energy: Float, cos_zenith: Float) -> Float:
    """J of both charges [1/(m2 s sr GeV)] at a kinetic energy [GeV] and cos zenith.

    J = 1400 (E (1 + 3.64 / (E c*^1.29)))^-2.7 (1 / (1 + 1.1 E c* / 115) + 0.054 / (1 + 1.1 E c* / 850)) with the total
    energy E and c* = `production_cosine`.
    """
    total, cosine = energy + MUON_MASS, production_cosine(cos_zenith)
    slowed = total + 3.64 / cosine**1.29
    return 1400 * slowed**-2.7 * (pion_part(total, cosine) + kaon_part(total, cosine))


def gccly(charge_ratio: float = CHARGE_RATIO) -> Flux:
    """Return the flux with so many mu+ for each mu-, since the formula knows no charge."""
    return of_one_charge_ratio("gccly", "flux of Guan et al. (arXiv:1509.06176)", intensity, charge_ratio)
