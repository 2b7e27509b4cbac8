"""Monotone maps of one variable, with a condition."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import nnls
from torch import nn
from torch.nn.functional import softplus

__all__ = ["ConditionalMonotoneMap", "MonotoneMap", "perceptron"]

_SMALLEST_SLOPE = 1e-12


def perceptron(*sizes: int) -> nn.Sequential:
    """Linear layers of the given sizes with SiLU between them."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        layers += [nn.Linear(inputs, outputs), nn.SiLU()]
    return nn.Sequential(*layers[:-1])


class MonotoneMap(nn.Module):
    """s(t) = a + b t + sum_i g_i w tanh((t - c_i) / w), strictly increasing since b and all g_i are positive.

    A network of one hidden layer with evenly spaced centres c_i, w apart. Straight lines go on
    outside of them. (Positive weights, as in J. Sill, "Monotonic networks", NIPS 10 (1997).)

    Parameters
    ----------
    units
        How many centres.
    reach
        They lie between -reach and +reach.
    """

    centres: torch.Tensor

    def __init__(self, units: int, reach: float) -> None:
        super().__init__()
        self.register_buffer("centres", torch.linspace(-reach, reach, units))
        self.width = 2 * reach / (units - 1)
        self.coefficients = nn.Parameter(self.initial_coefficients())

    def initial_coefficients(self) -> torch.Tensor:
        """Return raw a, b and g [2 + units] of a line of slope 0.6, most of it from the units.

        Units that begin near zero have no gradient to leave it by, and leave ripples in the slope.
        """
        raw = torch.full((2 + len(self.centres),), -1.26)
        raw[0], raw[1] = 0.0, -2.0
        return raw

    def forward(self, t: torch.Tensor) -> torch.Tensor:
        """Map t of any shape."""
        return self.combine(t, self.coefficients)

    def solve(self, t: NDArray[np.float64], s: NDArray[np.float64], weight: NDArray[np.float64]) -> None:
        """Take the coefficients that make the weighted squared difference of s(t) and s [n] the smallest there is.

        The map is linear in its coefficients, so this is a problem of non-negative least squares, with one solution.
        """
        bumps = np.tanh((t[:, None] - self.centres.double().numpy()) / self.width) * self.width
        columns = np.column_stack([np.ones_like(t), -np.ones_like(t), t, bumps]) * weight[:, None]
        norm = np.linalg.norm(columns, axis=0)  # columns of one length: the solver's tolerance is absolute
        solution = nnls(columns / norm, s * weight)[0] / norm
        slopes = np.maximum(solution[2:], _SMALLEST_SLOPE)
        raw = np.concatenate([[solution[0] - solution[1]], slopes + np.log(-np.expm1(-slopes))])
        with torch.no_grad():
            self.coefficients.copy_(torch.from_numpy(raw))

    def combine(self, t: torch.Tensor, raw: torch.Tensor) -> torch.Tensor:
        """Map t [..., m] with raw coefficients [..., 2 + units]; the slope parameters pass through softplus."""
        bumps = torch.tanh((t.unsqueeze(-1) - self.centres) / self.width) * self.width
        slopes = softplus(raw[..., 1:])
        curved = bumps @ slopes[..., 1:].unsqueeze(-1)
        return raw[..., :1] + slopes[..., :1] * t + curved.squeeze(-1)


class ConditionalMonotoneMap(MonotoneMap):
    """A monotone map of t whose coefficients a second network makes from a condition.

    Parameters
    ----------
    units, reach
        As in `MonotoneMap`.
    conditions
        Size of the condition.
    hidden
        Width of the two hidden layers that read it.
    """

    def __init__(self, units: int, reach: float, conditions: int, hidden: int) -> None:
        super().__init__(units, reach)
        self.network = perceptron(conditions, hidden, hidden, 2 + units)
        for parameter in self.network[-1].parameters():
            nn.init.zeros_(parameter)

    def forward(self, t: torch.Tensor, condition: torch.Tensor) -> torch.Tensor:  # type: ignore[override]
        """Map t [n, m], m values for each of n conditions [n, conditions]."""
        return self.combine(t, self.coefficients + self.network(condition))
