from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from deepmuon_training.generators.quantile.pinball import pinball_loss

N = 100_000


@pytest.fixture(scope="module")
def exponential():
    """Times with density exp(-y), whose quantile at a level is -log(1 - level)."""
    return torch.from_numpy(np.random.default_rng(1).exponential(size=N))


@pytest.mark.parametrize("level", [0.001, 0.05, 0.5, 0.9, 0.999])
def test_the_loss_is_smallest_at_the_quantile(exponential, level):
    tensor_level = torch.tensor(level, dtype=torch.float64)
    found = minimize_scalar(
        lambda q: float(pinball_loss(torch.tensor(q), exponential, tensor_level).mean()),
        bounds=(0, 20),
        options={"xatol": 1e-9},
    ).x
    error = np.sqrt(level / (1 - level) / N)  # standard error of a sample's quantile
    assert abs(found + np.log1p(-level)) < 4 * error  # false alarms: 6e-5


@given(quantile=st.floats(0.01, 8), level=st.floats(0.01, 0.99))
def test_the_gradient_is_the_fraction_below_less_the_level(exponential, quantile, level):
    predicted = torch.tensor(quantile, dtype=torch.float64, requires_grad=True)
    pinball_loss(predicted, exponential, torch.tensor(level)).mean().backward()
    below = np.mean(exponential.numpy() < quantile)
    assert float(predicted.grad) == pytest.approx(below - level, abs=1e-6)


def test_each_of_several_levels_of_one_muon_counts():
    predicted = torch.tensor([[1.0, 3.0], [0.0, 0.0]])
    observed, level = torch.tensor([[2.0], [-1.0]]), torch.tensor([0.25, 0.75])
    terms = torch.tensor([[0.25, 0.25], [0.75, 0.25]])
    torch.testing.assert_close(pinball_loss(predicted, observed, level), terms)


@given(y=st.floats(-0.5, 1.5))
def test_over_all_levels_it_is_half_the_continuous_ranked_probability_score(y):
    levels = (torch.arange(100_000, dtype=torch.float64) + 0.5) / 100_000  # of the uniform distribution on [0, 1]
    inside = np.clip(y, 0, 1)
    score = (inside**3 + (1 - inside) ** 3) / 3 + abs(y - inside)
    losses = pinball_loss(levels, torch.tensor(y, dtype=torch.float64), levels)
    assert float(losses.mean()) == pytest.approx(score / 2, abs=1e-9)
