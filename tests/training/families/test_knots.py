from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.engines import reference_evaluator

from deepmuon_training.export.graph import Graph
from deepmuon_training.families.knots import Knots, column_density_graph, risen, risen_graph

DEPTHS = [0, 0.1, 0.3, 1, 3, 6, 10, 20, 30, 40, 50, 70, 100]
SOME_DEPTHS = st.lists(st.floats(0, 5000, width=32), min_size=2, max_size=12, unique_by=lambda z: round(z, 1))


def in_graph(knots: Knots, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """The used knots and their weights, as ONNX's reference evaluator has them."""
    g = Graph()
    x = column_density_graph(g, g.changeable(np.array(depth, dtype=np.float32), "depth_m"), knots.density)
    used, weights = knots.weights_graph(g, x)
    g("Mul", "latent", 1.0)
    model = g.model({"latent": ["n"]}, {"used": (used, 7, ["p"]), "weights": (weights, 1, [1, "p"])}, {})
    found_used, found_weights = reference_evaluator(model).run(None, {"latent": np.zeros(1, np.float32)})
    return found_used, found_weights[0]


@given(SOME_DEPTHS, st.sampled_from([1.0, 2.65]))
def test_at_a_knot_its_own_map_counts_alone(depths, density):
    knots = Knots(sorted(depths), density)
    for number, depth in enumerate(sorted(depths)):
        used, weights = knots.weights(depth)
        np.testing.assert_array_equal(weights, used == number)
        used, weights = in_graph(knots, depth)
        np.testing.assert_array_equal(weights, used == number)


@given(SOME_DEPTHS, st.floats(0, 1))
def test_what_is_a_cubic_in_s_is_interpolated_exactly(depths, place):
    depths = sorted(depths)
    depth = float(np.float32(depths[0] + place * (depths[-1] - depths[0])))
    powers = range(min(len(depths), 4))
    s = np.log(np.array(depths) + 0.7)
    used, weights = Knots(depths, 1.0).weights(depth)
    for power in powers:
        np.testing.assert_allclose(weights @ s[used] ** power, np.log(depth + 0.7) ** power, rtol=1e-4, atol=1e-4)


@given(st.floats(0, 100, width=32))
def test_the_graph_has_the_same_weights(depth):
    used, weights = Knots(DEPTHS, 1.0).weights(depth)
    found_used, found_weights = in_graph(Knots(DEPTHS, 1.0), depth)
    np.testing.assert_array_equal(found_used, used)
    np.testing.assert_allclose(found_weights, weights, atol=1e-5)


def test_the_four_nearest_knots_count():
    assert Knots(DEPTHS, 1.0).weights(7.0)[0].tolist() == [4, 5, 6, 7]
    assert Knots(DEPTHS, 1.0).weights(0.05)[0].tolist() == [0, 1, 2, 3]
    assert Knots(DEPTHS, 1.0).weights(99.0)[0].tolist() == [9, 10, 11, 12]


@pytest.mark.parametrize("length", [3, 5, 129, 2177])
def test_rows_rise_from_the_middle_on_where_they_did_not(length):
    table = np.random.default_rng(1).normal(size=(3, length)).astype(np.float32)
    g = Graph()
    name = risen_graph(g, g("Mul", "table", 1.0), length)
    model = g.model({"table": [3, length]}, {"risen": (name, 1, [3, length])}, {})
    (found,) = reference_evaluator(model).run(None, {"table": table})
    np.testing.assert_array_equal(found, risen(table))
    assert np.all(np.diff(found, axis=1) >= 0)
    np.testing.assert_array_equal(found[:, length // 2], table[:, length // 2])
    np.testing.assert_array_equal(risen(found), found)
