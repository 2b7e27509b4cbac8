"""Interpolation between knots of depth, in NumPy and in an ONNX graph.

What is interpolated are maps at the same latents (displacement interpolation: R. J. McCann, Adv. Math. 128 (1997)
153). The coordinate is s = ln(density x depth + 0.7 m of water): energy loss is some 0.2 GeV a metre, so that near the
surface the spectrum changes over decimetres, and in the deep over many metres. Between two knots goes the polynomial
through the four nearest (Lagrange's), so that at a knot there is nothing but its own map.

Knots are stored as x = density x depth + 0.7, and differences of s are logarithms of ratios of x: at a knot that is
ln 1, exactly 0 in every runtime, and all weights but one are 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import TensorProto

from deepmuon_training.export.graph import Graph
from deepmuon_training.export.graph_steps import END, cut

__all__ = ["OFFSET", "Knots", "column_density", "column_density_graph", "interval", "risen", "risen_graph"]

OFFSET = 0.7
"""Metres of water in s."""

_POINTS = 4


def column_density(depth_m: float | Sequence[float], density: float) -> NDArray[np.float32]:
    """Return x at depths [m], by the operations that the graph does."""
    x: NDArray[np.float32] = np.asarray(depth_m, dtype=np.float32) * np.float32(density) + np.float32(OFFSET)
    return x


def column_density_graph(g: Graph, depth_m: str, density: float) -> str:
    """Build the same in ONNX, of a scalar."""
    return g("Add", g("Mul", depth_m, density), OFFSET)


def interval(g: Graph, knots: str, x: str, last: int) -> str:
    """Return the number of the interval that a scalar x lies in, 0 to `last`, as float32: the first knot is 0."""
    below = g("Cast", g("LessOrEqual", knots, x), to=TensorProto.FLOAT)
    return g("Clip", g("Sub", g("ReduceSum", below, np.array([0], dtype=np.int64), keepdims=0), 1.0), 0.0, float(last))


def risen(table: NDArray[Any]) -> NDArray[Any]:
    """Return a matrix [m, n] whose rows rise from both ends of the middle column: tails follow the bulk.

    Where interpolation lets a row fall, few muons are: to the right of the middle it takes the largest value from there
    on, to the left the smallest. From the left end on, it would lift the bulk to whatever is wrong in a tail.
    """
    middle = table.shape[1] // 2
    left = np.minimum.accumulate(table[:, middle::-1], axis=1)[:, ::-1]
    right = np.maximum.accumulate(table[:, middle:], axis=1)
    return np.concatenate([left[:, :-1], right], axis=1)


def risen_graph(g: Graph, table: str, length: int) -> str:
    """Build the same in ONNX, which has no operator for a running maximum.

    It is that of a number and of those k places before it, for k = 1, 2, 4, ...
    """
    middle = length // 2
    left, right = cut(g, table, 1, 0, middle + 1), cut(g, table, 1, middle, END)
    shift = 1
    while shift <= middle:
        left_end, right_end = cut(g, left, 1, -shift, END), cut(g, right, 1, 0, shift)
        left = g("Concat", g("Min", cut(g, left, 1, 0, -shift), cut(g, left, 1, shift, END)), left_end, axis=1)
        right = g("Concat", right_end, g("Max", cut(g, right, 1, shift, END), cut(g, right, 1, 0, -shift)), axis=1)
        shift *= 2
    return g("Concat", cut(g, left, 1, 0, -1), right, axis=1)


class Knots:
    """Depths at which something is known, and how to go from one to the other.

    Parameters
    ----------
    depths
        In metres, ascending; two or more.
    density
        Of the overburden in g/cm3.
    """

    def __init__(self, depths: Sequence[float], density: float) -> None:
        self.x = column_density(depths, density)
        self.density = density
        points = min(_POINTS, len(depths))
        self._points = np.arange(points)
        self._starts = len(depths) - points + 1
        s = np.log(self.x.astype(np.float64))
        windows = s[np.arange(self._starts)[:, None] + self._points]
        differences = windows[:, :, None] - windows[:, None, :] + np.eye(points)
        self._scale = 1 / np.prod(differences, axis=2)

    def weights(self, depth_m: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the numbers of the knots that count at a depth, and their weights, which sum up to 1."""
        x = float(column_density(depth_m, self.density))
        start = int(np.clip(np.sum(self.x <= x) - 2, 0, self._starts - 1))
        used = start + self._points
        difference = np.log(x / self.x[used].astype(np.float64))
        others = np.where(np.eye(len(used)) == 1, 1.0, difference)
        weights = np.prod(others, axis=1) * self._scale[start]
        return used, weights / weights.sum()

    def weights_graph(self, g: Graph, x: str) -> tuple[str, str]:
        """Build the same in ONNX, of a scalar x: int64 [p] and float32 [1, p]."""
        knots = g.constant(self.x, "depth/knots")
        start = g("Sub", interval(g, knots, x, len(self.x) - 1), 1.0)
        start = g("Cast", g("Clip", start, 0.0, float(self._starts - 1)), to=TensorProto.INT64)
        used = g("Add", start, self._points.astype(np.int64))
        difference = g("Log", g("Div", x, g("Gather", knots, used, axis=0)))
        points = len(self._points)
        each = g.several("Split", points, difference, axis=0, num_outputs=points)
        products = []
        for own in range(points):
            product, *others = (each[other] for other in range(points) if other != own)
            for other in others:
                product = g("Mul", product, other)
            products.append(product)
        scale = g("Gather", self._scale.astype(np.float32), start, axis=0)
        weights = g("Mul", g("Concat", *products, axis=0), scale)
        # Else rounding, a part in a million of the sum, would be one of ln E itself and not of what knots differ by.
        weights = g("Div", weights, g("ReduceSum", weights, np.array([0], dtype=np.int64), keepdims=1))
        return used, g("Reshape", weights, np.array([1, points], dtype=np.int64))
