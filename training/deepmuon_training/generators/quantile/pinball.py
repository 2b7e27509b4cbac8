"""The pinball (quantile) loss."""

from __future__ import annotations

import torch

__all__ = ["pinball_loss"]


def pinball_loss(predicted: torch.Tensor, observed: torch.Tensor, level: torch.Tensor) -> torch.Tensor:
    """Return level (y - q) where y > q, and (1 - level) (q - y) elsewhere.

    Its expectation is smallest where q is the quantile of y at `level` (R. Koenker and G. Bassett, Econometrica 46
    (1978) 33); averaged over all levels it is half the continuous ranked probability score, a one-dimensional
    transport cost.

    Parameters
    ----------
    predicted, observed, level
        q, y and the level in (0, 1), of shapes that broadcast together.
    """
    difference = observed - predicted
    return torch.maximum(level * difference, (level - 1) * difference)
