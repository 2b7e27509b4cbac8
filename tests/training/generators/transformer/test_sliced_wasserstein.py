from __future__ import annotations

import numpy as np
import ot
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_training.generators.transformer.sliced_wasserstein import (
    SEGMENT_WEIGHT,
    deepmuon_loss,
    random_directions,
    segment_distance,
    sliced_wasserstein,
)


def normal(n: int, seed: int, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    return torch.randn(n, 3, dtype=dtype, generator=torch.Generator().manual_seed(seed))


def directions(count: int, seed: int = 0) -> torch.Tensor:
    return random_directions(count, 3, torch.Generator().manual_seed(seed)).double()


@pytest.mark.parametrize(("n", "count"), [(1, 1), (100, 10), (2000, 64)])
def test_it_is_the_distance_of_python_optimal_transport(n, count):
    a, b = normal(n, 1), 0.5 * normal(n, 2) + 1
    expected = ot.sliced_wasserstein_distance(a.numpy(), b.numpy(), projections=directions(count).numpy(), p=1)
    assert float(sliced_wasserstein(a, b, directions(count))) == pytest.approx(float(expected), rel=1e-12)


def test_directions_are_unit_vectors_uniform_on_the_sphere():
    d = directions(100_000)
    torch.testing.assert_close(d.norm(dim=0), torch.ones(100_000, dtype=torch.float64), rtol=1e-6, atol=0)
    # a component is uniform in (-1, 1): mean square 1/3 with variance 4/45; three of them, false alarms 2e-4
    assert torch.all((d.square().mean(dim=1) - 1 / 3).abs() < 4 * (4 / 45 / 100_000) ** 0.5)


@given(seed=st.integers(0, 2**32 - 1))
def test_the_order_of_the_muons_does_not_matter(seed):
    a, b = normal(128, 1), normal(128, 2)
    shuffled = a[torch.randperm(128, generator=torch.Generator().manual_seed(seed))]
    assert float(deepmuon_loss(a, shuffled, directions(8))) == 0
    torch.testing.assert_close(deepmuon_loss(shuffled, b, directions(8)), deepmuon_loss(a, b, directions(8)))


def test_a_shift_costs_its_mean_projection():
    shift, d = torch.tensor([0.3, -0.2, 0.9], dtype=torch.float64), directions(50)
    torch.testing.assert_close(sliced_wasserstein(normal(500, 1) + shift, normal(500, 1), d), (shift @ d).abs().mean())


@pytest.mark.parametrize("loss", [segment_distance, lambda a, b: sliced_wasserstein(a, b, directions(16))])
def test_the_gradient_is_the_one_of_sorting_in_pytorch(loss, monkeypatch):
    b = normal(640, 2)

    def gradient() -> torch.Tensor:
        a = normal(640, 1).requires_grad_()
        value = loss(a, b)
        value.backward()
        torch.testing.assert_close(value.detach(), loss(a.detach(), b))
        return a.grad

    ours = gradient()
    monkeypatch.setattr(
        "deepmuon_training.generators.transformer.sliced_wasserstein._sorted",
        lambda columns: columns.T.contiguous().sort(dim=1).values,
    )
    torch.testing.assert_close(ours, gradient())


def test_the_segment_distance_is_relative_to_the_spread_of_each_thirty_second():
    even = torch.arange(640, dtype=torch.float64).unsqueeze(1)  # 20 values a segment, spread 19
    assert float(segment_distance(even + 3, even)) == pytest.approx(3 / 19)
    first = torch.where(even < 20, even - 100, even)  # one segment of 32 is moved
    assert float(segment_distance(first, even)) == pytest.approx(100 / 19 / 32)


@given(scale=st.floats(0.1, 100))
def test_the_segment_distance_has_no_unit(scale):
    a, b = normal(640, 1), normal(640, 2)
    torch.testing.assert_close(segment_distance(scale * a, scale * b), segment_distance(a, b))


def test_the_papers_loss_adds_a_tenth_of_the_segment_distance():
    a, b, d = normal(320, 1), normal(320, 2), directions(4)
    expected = sliced_wasserstein(a, b, d) + 0.1 * segment_distance(a, b)
    assert SEGMENT_WEIGHT == 0.1
    torch.testing.assert_close(deepmuon_loss(a, b, d), expected)


def test_alike_samples_are_nearer_than_different_ones():
    d = directions(64)
    alike = sliced_wasserstein(normal(5000, 1), normal(5000, 2), d)
    assert float(alike) < 0.05 < float(sliced_wasserstein(normal(5000, 1), 1.2 * normal(5000, 2), d))
    assert np.isfinite(float(alike))
