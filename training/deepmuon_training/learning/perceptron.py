"""The small network that charge and azimuth are."""

from __future__ import annotations

from itertools import pairwise

from torch import nn

__all__ = ["perceptron"]


def perceptron(*sizes: int) -> nn.Sequential:
    """Linear layers of the given sizes with SiLU between them."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        layers += [nn.Linear(inputs, outputs), nn.SiLU()]
    return nn.Sequential(*layers[:-1])
