"""The `quantile` generator: a triangular transport map, one muon a draw.

Energy from one latent, zenith from another given the energy, charge from a third given both, azimuth from a fourth,
uniform or given both: a Knothe-Rosenblatt map (G. Carlier, A. Galichon, F. Santambrogio, SIAM J. Math. Anal. 41 (2010)
2554), each step monotone in its latent and so the solution of a one-dimensional transport problem.
"""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import numpy as np
import torch
from torch import nn

from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.generators.quantile.azimuth_fit import AzimuthDensity
from deepmuon_training.learning.charge import ChargeProbability
from deepmuon_training.learning.condition import EnergyCondition
from deepmuon_training.learning.monotone import ConditionalMonotoneMap, MonotoneMap
from deepmuon_training.learning.power_law import PowerLawTails

__all__ = ["QuantileGenerator"]

_ROUNDING = 2.0**-21  # relative, of cos zenith in the graph
_STEEPEST_COSINE = 1 - 1e-12  # 1.4 microradian from the vertical

_LEVEL_REACH = 12.0  # logit of the levels that the maps bend over: probabilities down to 6e-6


class QuantileGenerator(nn.Module):
    """Energy, zenith and charge maps as networks.

    Parameters
    ----------
    transform
        Between energy and the networks' coordinate y = x - mean.
    tails
        The power laws beyond what the energy network is trained on.
    charge
        The probability of mu+.
    azimuth
        Its density, or None where it is uniform.
    cos_zenith_min
        No muon is flatter.
    """

    def __init__(
        self,
        transform: EnergyTransform,
        tails: PowerLawTails,
        charge: ChargeProbability,
        azimuth: AzimuthDensity | None = None,
        cos_zenith_min: float = 0.0,
    ) -> None:
        super().__init__()
        self.cos_zenith_min = cos_zenith_min
        self.transform, self.tails, self.charge, self.azimuth = transform, tails, charge, azimuth
        self.energy = MonotoneMap(units=97, reach=_LEVEL_REACH)
        self.zenith = ConditionalMonotoneMap(units=33, reach=_LEVEL_REACH, conditions=1, hidden=64)

    @property
    def condition(self) -> EnergyCondition:
        """Scales y for the networks that are conditional on it."""
        return self.charge.condition

    def pre_tanh(self, logit: torch.Tensor) -> torch.Tensor:
        """Return y [n] at logits [n] of the energy's level; the tails are power laws."""
        y = self.energy(logit)
        edge = torch.logit(torch.tensor(self.tails.level, dtype=torch.float64)).to(logit)
        level = torch.sigmoid(-logit.abs().double()).numpy()
        low = self.transform.pre_tanh(torch.from_numpy(self.tails.lowest(level))).to(logit)
        high = self.transform.pre_tanh(torch.from_numpy(self.tails.highest(level))).to(logit)
        y = torch.where(logit < edge, low, torch.where(logit > -edge, high, y))
        ends = self.transform.pre_tanh(np.array([self.tails.energy_min, self.tails.energy_max]))
        return y.clamp(*ends.tolist())

    def join_tails(self) -> None:
        """Let the power laws begin at the energies where the network ends, so that the spectrum has no gap there."""
        edge = torch.logit(torch.tensor([self.tails.level, 1 - self.tails.level], dtype=torch.float64))
        with torch.no_grad():
            low, high = self.transform.energy(copy.deepcopy(self.energy).double()(edge)).tolist()
        low, high = max(low, self.tails.energy_min), min(high, self.tails.energy_max)
        self.tails = replace(self.tails, low=low, high=high)

    def cos_zenith_logit(self, logit: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        """Return logit of cos zenith [n, m] at logits [n, m] of its level, given y [n]."""
        result: torch.Tensor = self.zenith(logit, self.condition(y).unsqueeze(-1))
        return result.clamp(min=_least_logit(self.cos_zenith_min))


def _least_logit(cos_zenith_min: float) -> float:
    """Return the logit of cos zenith under which float32 would be below the least; minus infinity for 0."""
    if cos_zenith_min <= 0:
        return -math.inf
    least = min(cos_zenith_min * (1 + _ROUNDING), _STEEPEST_COSINE)
    return math.log(least / (1 - least))
