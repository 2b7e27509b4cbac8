"""The paper's preprocessing of kinetic energy: inverse Box-Cox transformation, mean, tanh; and its inverse.

The inverse Box-Cox transformation, x = (lambda E + 1)^(1 / lambda) with lambda = 9 and E in MeV, takes the energy's
kurtosis from thousands to about 4 (DeepMuon, eq. 2). Then x - mean is what the networks here make and what their
losses compare; tanh(x - mean) is the paper's bounded feature. The exported graphs start from x - mean:
going through tanh and back would only lose digits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray

__all__ = ["LAMBDA", "EnergyTransform", "box_cox", "inverse_box_cox"]

LAMBDA = 9
"""Parameter of the Box-Cox transformation."""

MEV_PER_GEV = 1000.0

Array = TypeVar("Array", NDArray[np.float32], NDArray[np.float64], torch.Tensor)


def inverse_box_cox(kinetic_energy: Array) -> Array:
    """Return x = (9 E + 1)^(1/9), E being the kinetic energy, given in GeV, in MeV."""
    return (kinetic_energy * (LAMBDA * MEV_PER_GEV) + 1) ** (1 / LAMBDA)


def box_cox(x: Array) -> Array:
    """Return the kinetic energy [GeV] of x, (x^9 - 1) / 9 MeV, by multiplications as in the exported graph."""
    x2 = x * x
    x4 = x2 * x2
    return (x4 * x4 * x - 1) * (1 / (LAMBDA * MEV_PER_GEV))


@dataclass(frozen=True)
class EnergyTransform:
    """Between kinetic energy and the networks' coordinate.

    Parameters
    ----------
    mean : float
        Mean of `inverse_box_cox` over the training muons.
    """

    mean: float

    @classmethod
    def fit(cls, kinetic_energy: NDArray[np.float32]) -> EnergyTransform:
        """Take the mean over kinetic energies [GeV]."""
        return cls(float(np.mean(inverse_box_cox(kinetic_energy.astype(np.float64)))))

    def pre_tanh(self, kinetic_energy: Array) -> Array:
        """Return x - mean of kinetic energies [GeV]."""
        return inverse_box_cox(kinetic_energy) - self.mean

    def energy(self, pre_tanh: Array) -> Array:
        """Return the kinetic energy [GeV] of x - mean."""
        return box_cox(pre_tanh + self.mean)

    def feature(self, kinetic_energy: torch.Tensor) -> torch.Tensor:
        """Return the paper's feature tanh(x - mean), within (-1, 1)."""
        return torch.tanh(self.pre_tanh(kinetic_energy))
