"""The `transformer` generator of the paper: d muons a draw from a hundred uniform numbers."""

from __future__ import annotations

import torch
from torch import nn

__all__ = ["HEADS", "LATENTS", "LAYERS", "Transformer"]

LATENTS = 100
HEADS = 8
LAYERS = 2


class Transformer(nn.Module):
    """Linear embedding, two-layer eight-head Transformer encoder, linear decoder (DeepMuon, section 2.2).

    The three tokens are read as energy, cos x and cos y of d muons. The result is before the paper's tanh: x - mean of
    the energy, and atanh of the cosines.

    Warning: the d muons of a draw are a stratified set, not independent ones, and its positions differ.

    Parameters
    ----------
    d
        Width of a token and muons of a draw, a multiple of 8; 1024 in the paper.
    """

    def __init__(self, d: int) -> None:
        super().__init__()
        self.d = d
        self.embedding = nn.Linear(LATENTS, 3 * d)
        self.norm = nn.LayerNorm(d)
        layer = nn.TransformerEncoderLayer(
            d, HEADS, dim_feedforward=2 * d, dropout=0.0, activation="gelu", batch_first=True
        )
        self.encoder = nn.TransformerEncoder(layer, LAYERS, enable_nested_tensor=False)
        self.decoder = nn.Linear(d, d)

    def forward(self, latent: torch.Tensor) -> torch.Tensor:
        """Map latents [draws, 100], uniform in (-1, 1), to pre-tanh values [draws, 3, d]."""
        tokens = self.embedding(latent).reshape(-1, 3, self.d)
        tokens = nn.functional.gelu(self.norm(tokens))
        result: torch.Tensor = self.decoder(self.encoder(tokens))
        return result
