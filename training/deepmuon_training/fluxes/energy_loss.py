"""Energy that a muon loses in air by ionisation: the reason why slow muons are rare."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deepmuon_training.fluxes.flux import MUON_MASS

__all__ = ["ionisation_loss"]

_COEFFICIENT = 0.307075e-3
"""4 pi N_A r_e^2 m_e c^2 [GeV cm2/mol]."""

_ELECTRON_MASS = 0.51099895e-3  # GeV

_AIR_Z_TO_A = 0.49919
_AIR_EXCITATION = 85.7e-9  # GeV

Float = NDArray[np.float64]


def ionisation_loss(kinetic_energy: Float) -> Float:
    """Mean loss S [GeV cm2/g] of a muon of a kinetic energy [GeV] in dry air.

    Bethe's formula without its density effect (Review of Particle Physics 2024, equation 34.5), which in air begins
    at 5.7 GeV and would put a kink there; Z/A and the mean excitation energy of dry air are from its tables. Below
    0.3 GeV the loss in water has the same shape within 0.7 %, and in standard rock within 5 %.
    """
    gamma = 1 + kinetic_energy / MUON_MASS
    square = gamma**2 - 1  # (beta gamma)^2
    beta2 = square / gamma**2
    ratio = _ELECTRON_MASS / MUON_MASS
    largest = 2 * _ELECTRON_MASS * square / (1 + 2 * gamma * ratio + ratio**2)  # transfer in one collision
    logarithm = 0.5 * np.log(2 * _ELECTRON_MASS * square * largest / _AIR_EXCITATION**2)
    loss: Float = _COEFFICIENT * _AIR_Z_TO_A / beta2 * (logarithm - beta2)
    return loss
