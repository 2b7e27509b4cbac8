"""A density on the circle, given conditions."""

from __future__ import annotations

import torch
from torch import nn

from deepmuon_training.learning.perceptron import perceptron

__all__ = ["CircularDensity"]


class CircularDensity(nn.Module):
    """log p(phi | c) = sum_k a_k(c) cos(k phi) + b_k(c) sin(k phi) - log Z(c): positive, smooth and periodic.

    The exponential family of the trigonometric moments, also called generalised von Mises distribution (R. Gatto and
    S. R. Jammalamadaka, Stat. Methodol. 4 (2007) 341), whose coefficients a network makes from the condition. It
    begins as the uniform distribution. It is evaluated in the middle of equal parts of the circle.

    Parameters
    ----------
    conditions
        Size of the condition.
    hidden
        Width of the two hidden layers.
    harmonics
        How many k there are, from 1 on.
    bins
        Parts of the circle, from -pi to pi: four and more to a period of the highest harmonic.
    """

    waves: torch.Tensor

    def __init__(self, conditions: int, hidden: int, harmonics: int, bins: int) -> None:
        super().__init__()
        self.network = perceptron(conditions, hidden, hidden, 2 * harmonics)
        for parameter in self.network[-1].parameters():
            nn.init.zeros_(parameter)
        middle = (torch.arange(bins) + 0.5) * (2 * torch.pi / bins) - torch.pi
        phase = torch.arange(1, harmonics + 1).unsqueeze(1) * middle
        self.register_buffer("waves", torch.cat([torch.cos(phase), torch.sin(phase)]))

    def forward(self, condition: torch.Tensor) -> torch.Tensor:
        """Return the logarithm of each part's probability [n, bins], given conditions [n, conditions]."""
        return torch.log_softmax(self.network(condition) @ self.waves, dim=1)

    def cumulative(self, condition: torch.Tensor) -> torch.Tensor:
        """Return the cumulative distribution [n, bins + 1] at the edges of the parts, from 0 to 1."""
        return nn.functional.pad(self(condition).exp().cumsum(dim=1), (1, 0))
