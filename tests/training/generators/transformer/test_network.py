from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from deepmuon_training.generators.transformer.network import LATENTS, Transformer

DRAWS = 5


def parameters(d: int) -> int:
    """Embedding, its norm, two layers of attention, feed-forward and norms, decoder."""
    linear = {(100, 3 * d): 1, (d, d): 4 * 2 + 1, (d, 2 * d): 2, (2 * d, d): 2}
    norms = 1 + 2 * 2
    return sum(count * (i * o + o) for (i, o), count in linear.items()) + norms * 2 * d


@pytest.mark.parametrize("d", [8, 24, 128, 1024])
def test_the_network_has_the_papers_layers(d):
    with torch.device("meta"):  # no memory for 18 million weights
        network = Transformer(d)
    assert sum(parameter.numel() for parameter in network.parameters()) == parameters(d)
    assert LATENTS == 100
    assert len(network.encoder.layers) == 2
    for layer in network.encoder.layers:
        assert layer.self_attn.num_heads == 8
        assert layer.linear1.out_features == 2 * d
        assert layer.dropout.p == 0


def test_the_papers_d_of_1024_has_18_million_parameters():
    assert parameters(1024) == 18_161_664


@given(d=st.integers(1, 16).map(lambda n: 8 * n), draws=st.integers(1, 4))
@settings(max_examples=20)
def test_any_multiple_of_8_makes_d_muons_a_draw(d, draws):
    with torch.no_grad():
        assert Transformer(d)(torch.rand(draws, LATENTS)).shape == (draws, 3, d)


def test_another_d_is_an_error():
    with pytest.raises(AssertionError, match="divisible"):
        Transformer(12)


@pytest.fixture(scope="module")
def network() -> Transformer:
    torch.manual_seed(0)
    return Transformer(16).double()


@pytest.fixture(scope="module")
def latent() -> torch.Tensor:
    return 2 * torch.rand(DRAWS, LATENTS, dtype=torch.float64, generator=torch.Generator().manual_seed(1)) - 1


def encoded(layer: nn.TransformerEncoderLayer, tokens: torch.Tensor) -> torch.Tensor:
    """One encoder layer, written out: A. Vaswani et al., NIPS 30 (2017)."""
    attention, d = layer.self_attn, tokens.shape[-1]
    projected = tokens @ attention.in_proj_weight.T + attention.in_proj_bias
    q, k, v = (part.reshape(DRAWS, 3, 8, d // 8).transpose(1, 2) for part in projected.split(d, dim=-1))
    weights = torch.softmax(q @ k.transpose(2, 3) / (d / 8) ** 0.5, dim=-1)
    tokens = layer.norm1(tokens + attention.out_proj((weights @ v).transpose(1, 2).reshape(DRAWS, 3, d)))
    return layer.norm2(tokens + layer.linear2(nn.functional.gelu(layer.linear1(tokens))))


def test_the_network_is_embedding_norm_gelu_encoder_decoder(network, latent):
    with torch.no_grad():
        tokens = nn.functional.gelu(network.norm(network.embedding(latent).reshape(DRAWS, 3, 16)))
        for layer in network.encoder.layers:
            tokens = encoded(layer, tokens)
        torch.testing.assert_close(network(latent), network.decoder(tokens))


def test_a_draw_does_not_depend_on_the_others(network, latent):
    with torch.no_grad():
        torch.testing.assert_close(network(latent)[2:3], network(latent[2:3]))
