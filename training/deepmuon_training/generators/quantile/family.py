"""A family of `quantile` maps: tables at knots of depth, interpolated to those of any depth, in PyTorch and in ONNX.

The graph does so in nodes that depend on constants alone, and goes on from there as the graph of one depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from onnx import TensorProto

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.export.graph import Graph
from deepmuon_training.families.knots import Knots, column_density_graph, risen, risen_graph
from deepmuon_training.families.rates import KnownRate, Rates
from deepmuon_training.families.sphere import TriangularMap, through_sphere
from deepmuon_training.generators.quantile.cells import column_logits, energy_logits, row_logits, row_place
from deepmuon_training.generators.quantile.graph import ENERGY_LATENTS, LATENT_SIZE, NEAREST_HORIZON, quantile_graph
from deepmuon_training.generators.quantile.tables import QuantileTables

__all__ = ["QuantileFamily", "quantile_family"]

_TABLES = ("energy", "zenith", "charge")

_COMPARED = 20_000
"""Muons whose maps are compared."""


@dataclass(frozen=True)
class QuantileFamily:
    """Tables at knots of depth; make one by `quantile_family`.

    Parameters
    ----------
    depths
        Of the knots in metres, ascending.
    density
        Of the overburden in g/cm3.
    planes, spheres
        Each knot's tables, of the flux through a horizontal plane and through a sphere.
    rates
        Of both surfaces, or None where unknown.
    """

    depths: tuple[float, ...]
    density: float
    planes: tuple[QuantileTables, ...]
    spheres: tuple[QuantileTables, ...]
    rates: Rates | None

    architecture = "quantile"
    latent_size = LATENT_SIZE
    energy_latents = ENERGY_LATENTS
    muons_per_draw = 1
    surfaces = (0, 1)

    @property
    def energy_range(self) -> tuple[float, float]:
        """Lowest and highest kinetic energy [GeV] at any depth."""
        lows, highs = zip(*(knot.energy_range for knot in self.planes), strict=True)
        return min(lows), max(highs)

    @cached_property
    def _knots(self) -> Knots:
        return Knots(self.depths, self.density)

    @cached_property
    def _stacks(self) -> dict[str, NDArray[np.float32]]:
        """Tables by name, each [surfaces x knots, numbers]."""
        stacks = {name: _stack([getattr(knot, name) for knot in (*self.planes, *self.spheres)]) for name in _TABLES}
        # Where all knots are sure of a charge, it is sure between them, however weights round: beyond 1, it is clipped.
        sure = np.abs(stacks["charge"].sum(axis=0)) == len(stacks["charge"])
        stacks["charge"] = np.where(sure, 2 * stacks["charge"], stacks["charge"])
        return stacks

    def at(self, depth_m: float, surface: int = 0) -> QuantileTables:
        """Return the tables at a depth, in double precision."""
        used, weights = self._knots.weights(depth_m)
        used = used + surface * len(self.depths)
        like = self.planes[0]
        energy, zenith, charge = (
            (weights @ self._stacks[name][used].astype(np.float64)).reshape(getattr(like, name).shape)
            for name in _TABLES
        )
        return replace(
            like,
            energy=risen(energy[None])[0],
            zenith=risen(zenith),
            charge=np.clip(charge, -1, 1),
            energy_range=self.energy_range,
        )

    def rate(self, depth_m: float, surface: int = 0) -> float | None:
        """Return the rate at a depth, per m2 of the plane or of the sphere's projected area; None where unknown."""
        return None if self.rates is None else self.rates(depth_m, surface)

    @property
    def notes(self) -> tuple[str, ...]:
        """Tell how far the map of each knot is from what the other knots make of it."""
        if len(self.depths) < 3:
            return ("There is no knot between the first and the last: how good the depths between are can't be told.",)
        inner = [_left_out(self, number) for number in range(1, len(self.depths) - 1)]
        depth, energy, cosine = max(inner, key=lambda found: found[1])
        return (
            f"Of the knots between the first and the last, that of {depth:g} m is hardest to interpolate from its "
            f"neighbours: its muons would differ by {energy:.1%} of the energy and {cosine:.4f} of cos zenith (rms). "
            "Between knots it should be less.",
        )

    def graph(self) -> tuple[Graph, str, str, str, str | None]:
        """Build the same in ONNX; returns the graph and the names of energy, direction, charge, and rate if known."""
        g = Graph()
        depth = g.changeable(np.array(self.depths[0], dtype=np.float32), "depth_m")
        surface = g.changeable(np.array(self.surfaces[0], dtype=np.int32), "surface")
        with g.scope("depth"):
            surface = g("Cast", surface, to=TensorProto.INT64)
            x = column_density_graph(g, depth, self.density)
            used, weights = self._knots.weights_graph(g, x)
            used = g("Add", used, g("Mul", surface, np.array(len(self.depths), dtype=np.int64)))
            energy, zenith, charge = (self._table(g, name, used, weights) for name in _TABLES)
            rate = None if self.rates is None else self.rates.graph(g, x, surface)
        return g, *quantile_graph(g, energy, zenith, charge, self.energy_range), rate

    def _table(self, g: Graph, name: str, used: str, weights: str) -> str:
        stack, shape = self._stacks[name], getattr(self.planes[0], name).shape
        table = g("MatMul", weights, g("Gather", g.constant(stack, f"depth/{name}"), used, axis=0))
        matrix = shape if len(shape) == 2 else (1, *shape)
        table = g("Reshape", table, np.array(matrix, dtype=np.int64))
        table = g("Clip", table, -1.0, 1.0) if name == "charge" else risen_graph(g, table, matrix[1])
        if matrix != shape:
            table = g("Reshape", table, np.array(shape, dtype=np.int64))
        return g.named(table, f"{name}/table")


def quantile_family(
    knots: Sequence[tuple[float, QuantileTables]], density: float, rates: Sequence[KnownRate]
) -> QuantileFamily:
    """Make a family of tables.

    Parameters
    ----------
    knots
        Depth in metres and tables of each, ascending; two or more.
    density
        Of the overburden in g/cm3.
    rates
        Through a horizontal plane, ascending in depth, from that of the first knot to that of the last; empty where
        they are unknown.

    Raises
    ------
    RefusedError
        If an azimuth is not uniform.
    """
    for depth, tables in knots:
        if tables.azimuth is not None:
            raise RefusedError(
                f"the generator of {depth:g} m has a learned azimuth, which is not interpolated in depth: fit each "
                "with --azimuth uniform"
            )
    depths, planes = zip(*knots, strict=True)
    spheres = tuple(_sphere(plane)[0] for plane in planes)
    family = QuantileFamily(depths, density, planes, spheres, None)
    if not rates:
        return family
    plane_rates = np.array([known.rate for known in rates])
    means = np.array([_sphere(family.at(known.depth_m))[1] for known in rates])
    both = np.stack([plane_rates, plane_rates * means])
    return replace(family, rates=Rates([known.depth_m for known in rates], both, density))


def _left_out(family: QuantileFamily, number: int) -> tuple[float, float, float]:
    """Return the depth of a knot, and how far muons are from its own if it is left out: rms, as in the notes."""
    own, others = family.planes[number], [k for k in range(len(family.depths)) if k != number]
    depths, planes = tuple(family.depths[k] for k in others), tuple(family.planes[k] for k in others)
    guess = replace(family, depths=depths, planes=planes, spheres=planes, rates=None).at(family.depths[number])
    latent = 2 * torch.rand(_COMPARED, LATENT_SIZE, generator=torch.Generator().manual_seed(0), dtype=torch.float64) - 1
    with torch.no_grad():
        (energy, direction, _), (own_energy, own_direction, _) = guess(latent), own(latent)
    ratio, turn = torch.log(energy / own_energy), direction[:, 2] - own_direction[:, 2]
    return family.depths[number], float((ratio**2).mean().sqrt()), float((turn**2).mean().sqrt())


def _sphere(plane: QuantileTables) -> tuple[QuantileTables, float]:
    """Return the tables of the flux through a sphere, and the mean of 1 / cos zenith."""
    t = energy_logits()
    *tables, mean = through_sphere(
        TriangularMap(
            t=t.numpy(),
            energy=plane.energy.astype(np.float64),
            row=row_place(t.numpy()),
            row_t=row_logits().numpy(),
            column=column_logits().numpy(),
            zenith=plane.zenith.astype(np.float64),
            charge=plane.charge.astype(np.float64),
            least_cosine=NEAREST_HORIZON,
        )
    )
    energy, zenith, charge = (table.astype(np.float32) for table in tables)
    return replace(plane, energy=energy, zenith=zenith, charge=charge), mean


def _stack(tables: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
    return np.stack([table.reshape(-1) for table in tables])
