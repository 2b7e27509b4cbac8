"""Rates between depths: a cubic spline of ln rate in s, as for the maps, but through all depths where it is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from onnx import TensorProto
from scipy.interpolate import CubicSpline

from deepmuon_training.export.graph import RATE, Graph
from deepmuon_training.families.knots import column_density, interval

__all__ = ["KnownRate", "Rates"]


@dataclass(frozen=True)
class KnownRate:
    """A rate at a depth.

    Parameters
    ----------
    depth_m
        Metres of the overburden.
    rate
        Muons per second and m2.
    uncertainty
        Its statistical standard uncertainty; None where unknown.
    """

    depth_m: float
    rate: float
    uncertainty: float | None = None


class Rates:
    """Rates through several surfaces at any depth.

    Parameters
    ----------
    depths : [n]
        In metres, ascending; two or more.
    rates : [surfaces, n]
        Muons per second and m2.
    density
        Of the overburden in g/cm3.
    """

    def __init__(self, depths: Sequence[float], rates: NDArray[np.float64], density: float) -> None:
        self.density = density
        self.x = column_density(depths, density)
        spline = CubicSpline(np.log(self.x.astype(np.float64)), np.log(rates), axis=1)  # of two, a line; of three, a
        self._coefficients = spline.c.transpose(2, 1, 0)[:, :, ::-1]  # parabola; [surfaces, intervals, 1, s, s^2, ...]

    def __call__(self, depth_m: float, surface: int = 0) -> float:
        """Return the rate at a depth."""
        x = float(column_density(depth_m, self.density))
        number = int(np.clip(np.sum(self.x <= x) - 1, 0, len(self.x) - 2))
        inside = np.log(x / float(self.x[number]))
        return float(np.exp(np.polynomial.polynomial.polyval(inside, self._coefficients[surface, number])))

    def graph(self, g: Graph, x: str, surface: str | None) -> str:
        """Build the same in ONNX, of scalars; the surface is int64, None where there is one alone. Returns [1]."""
        knots = g.constant(self.x, "depth/rate_knots")
        intervals = len(self.x) - 1
        number = g("Cast", interval(g, knots, x, intervals - 1), to=TensorProto.INT64)
        inside = g("Log", g("Div", x, g("Gather", knots, number, axis=0)))
        if surface is not None:
            number = g("Add", number, g("Mul", surface, np.array(intervals, dtype=np.int64)))
        powers = self._coefficients.shape[2]
        table = self._coefficients.reshape(-1, powers).astype(np.float32)
        row = g("Gather", table, number, axis=0)
        *lower, value = g.several("Split", powers, row, axis=0, num_outputs=powers)
        for coefficient in reversed(lower):
            value = g("Add", g("Mul", value, inside), coefficient)
        return g.named(g("Exp", value), RATE)
