from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_training.learning.monotone import ConditionalMonotoneMap, MonotoneMap, perceptron

REACH = 12.0
GRID = torch.linspace(-20, 20, 2001, dtype=torch.float64)


def slope(s: MonotoneMap, t: torch.Tensor, *condition: torch.Tensor) -> torch.Tensor:
    t = t.clone().requires_grad_()
    s(t, *condition).sum().backward()
    return t.grad


def random_(shape: tuple[int, ...], scale: float, seed: int) -> torch.Tensor:
    return scale * torch.randn(shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))


@given(seed=st.integers(0, 2**32 - 1), scale=st.floats(0, 5), units=st.integers(2, 100))
def test_a_map_increases_whatever_its_weights(seed, scale, units):
    s = MonotoneMap(units, REACH).double()
    with torch.no_grad():
        s.coefficients.copy_(random_((2 + units,), scale, seed))
    assert torch.all(slope(s, GRID) > 0)


@given(seed=st.integers(0, 2**32 - 1), scale=st.floats(0, 1))
def test_a_conditional_map_increases_whatever_its_weights_and_its_condition(seed, scale):
    s = ConditionalMonotoneMap(units=33, reach=REACH, conditions=2, hidden=16).double()
    with torch.no_grad():
        for k, parameter in enumerate(s.parameters()):
            parameter.copy_(random_(tuple(parameter.shape), scale, seed + k))
    assert torch.all(slope(s, GRID.expand(20, -1), random_((20, 2), 3, seed + 99)) > 0)


@given(seed=st.integers(0, 2**32 - 1))
def test_straight_lines_go_on_outside_of_the_centres(seed):
    s = MonotoneMap(33, REACH).double()
    with torch.no_grad():
        s.coefficients.copy_(random_((35,), 1, seed))
        for end in (-1, 1):
            t = end * torch.linspace(REACH + 10, REACH + 30, 50, dtype=torch.float64)
            torch.testing.assert_close(s(t).diff().diff(), torch.zeros(48, dtype=torch.float64), rtol=0, atol=1e-8)


def test_an_untrained_map_is_nearly_a_straight_line_between_its_centres():
    s = MonotoneMap(97, REACH).double()
    inside = GRID[GRID.abs() < REACH - 2]
    assert torch.all((slope(s, inside) - 0.63).abs() < 0.03)


def test_an_untrained_conditional_map_does_not_depend_on_its_condition():
    s = ConditionalMonotoneMap(units=33, reach=REACH, conditions=1, hidden=8)
    with torch.no_grad():
        mapped = s(GRID.float().expand(2, -1), torch.tensor([[-1.0], [1.0]]))
    torch.testing.assert_close(mapped[0], mapped[1])


def test_a_map_of_many_values_is_the_map_of_each():
    s = MonotoneMap(17, REACH)
    t = torch.linspace(-3, 3, 12)
    torch.testing.assert_close(s(t.reshape(3, 4)), torch.stack([s(x) for x in t]).reshape(3, 4))


@pytest.mark.parametrize("function", [np.arctan, np.exp, lambda t: 2 * t + np.tanh(3 * t)])
def test_the_solution_follows_an_increasing_function(function):
    s = MonotoneMap(97, 6.0).double()
    t = np.linspace(-4, 4, 1001)
    s.solve(t, function(t), np.ones_like(t))
    with torch.no_grad():
        found = s(torch.from_numpy(t)).numpy()
    np.testing.assert_allclose(found, function(t), atol=1e-3 * np.ptp(function(t)))


@given(seed=st.integers(0, 2**32 - 1))
def test_no_other_coefficients_come_nearer_than_the_solution(seed):
    random = np.random.default_rng(seed)
    t = np.linspace(-5, 5, 200)
    values, weight = t + random.normal(size=200), random.uniform(0.1, 2, size=200)  # no increasing function
    s = MonotoneMap(17, 6.0).double()

    def distance() -> float:
        return float(np.mean((weight * (s(torch.from_numpy(t)).numpy() - values)) ** 2))

    with torch.no_grad():
        s.solve(t, values, weight)
        nearest, raw = distance(), s.coefficients.clone()
        for scale in (1e-3, 1e-2, 0.1, 1.0):
            s.coefficients.copy_(raw + scale * torch.from_numpy(random.normal(size=19)))
            assert nearest <= distance() * (1 + 1e-9)


def test_a_perceptron_has_silu_between_its_layers_and_none_at_its_end():
    network = perceptron(2, 5, 3, 1)
    assert [type(layer).__name__ for layer in network] == ["Linear", "SiLU", "Linear", "SiLU", "Linear"]
    assert network(torch.zeros(7, 2)).shape == (7, 1)
