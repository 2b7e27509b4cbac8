"""The `quantile` generator as an ONNX graph: what it does for each muon.

Forty-odd operations on one-dimensional tensors, six of them look-ups. Steps that float32 or a runtime asks for are
explained here; what is computed, and why so, is said in `quantile_cells`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from onnx import TensorProto

from deepmuon_training.export.graph import Graph
from deepmuon_training.export.graph_steps import LARGEST_LATENT, charge_sign, columns, look_up, matrix
from deepmuon_training.generators.quantile.azimuth_table import azimuth_turn_graph
from deepmuon_training.generators.quantile.cells import ENERGY_PER_UNIT, FINE_STEP, HORIZON_WEIGHT, ZENITH_CELLS
from deepmuon_training.generators.quantile.look_ups import look_ups_graph

__all__ = ["ENERGY_LATENTS", "LATENT_SIZE", "NEAREST_HORIZON", "quantile_graph"]

LATENT_SIZE = 5

ENERGY_LATENTS = (0, 1)
"""The coarse and the fine one of the energy, by the contract."""

NEAREST_HORIZON = 2.0**-20
"""Smallest cos zenith: no muon is horizontal, or goes up."""


def quantile_graph(
    g: Graph,
    energy: str,
    zenith: str,
    charge: str,
    energy_range: tuple[float, float],
    azimuth: NDArray[np.float32] | None = None,
) -> tuple[str, str, str]:
    """Add everything from the coarse tables and the latents to a muon.

    Parameters
    ----------
    g
        The graph, with the input ``latent`` [draws, 5].
    energy, zenith, charge
        Names of the coarse tables, as in `look_ups.look_ups`: constants, or outputs of nodes that depend on constants
        alone.
    energy_range
        Lowest and highest kinetic energy [GeV].
    azimuth
        Table of `azimuth_table`, or None where it is uniform.

    Returns
    -------
    Names of kinetic energy [n], direction [n, 3] and charge [n].
    """
    tables = look_ups_graph(g, energy, zenith, charge)
    with g.scope("latent"):
        l0, l1, l2, l3, l4 = columns(g, g("Clip", "latent", -LARGEST_LATENT, LARGEST_LATENT), LATENT_SIZE)
    with g.scope("energy"):
        fine = g("Mul", l1, FINE_STEP)
        odds = g("Div", g("Add", g("Add", l0, 1.0), fine), g("Add", g("Sub", 1.0, l0), fine))
        t = g("Log", odds)
        place = g("Mul", t, float(ENERGY_PER_UNIT))
        cell = g("Cast", place, to=TensorProto.INT32)
        start, slope, row = (look_up(g, x, cell) for x in (tables.energy_start, tables.energy_slope, tables.row))
        kinetic_energy = g("Clip", g("Add", start, g("Mul", place, slope)), *energy_range)
    with g.scope("zenith"):
        upper, lower = g("Sub", 1.0, l2), g("Add", l2, 1.0)
        unit = 2 / ZENITH_CELLS**2
        square = g("Div", upper, g("Add", g("Mul", g("Sqrt", lower), unit * HORIZON_WEIGHT), unit))
        cell = g("Add", row, g("Cast", g("Sqrt", square), to=TensorProto.INT32))
        start, slope = (look_up(g, x, cell) for x in (tables.versine_start, tables.versine_slope))
        versine = g("Clip", g("Add", start, g("Mul", square, slope)), 0.0, 1 - NEAREST_HORIZON)
    with g.scope("charge"):
        sign = charge_sign(g, l4, look_up(g, tables.charge, cell))
    with g.scope("azimuth"):
        if azimuth is not None:
            level = g("Log", g("Div", lower, upper))
            l3 = azimuth_turn_graph(g, azimuth, t, level, l3)
        angle = g("Mul", l3, float(np.pi))
    with g.scope("direction"):
        sine = g("Sqrt", g("Mul", versine, g("Sub", 2.0, versine)))
        u, v = g("Mul", sine, g("Cos", angle)), g("Mul", sine, g("Sin", angle))
        direction = matrix(g, u, v, g("Sub", versine, 1.0))
    return kinetic_energy, direction, sign
