"""Takes the steps of CRY's tables out of a muon sample.

CRY draws from histograms: inside a cell of 0.2 decade in kinetic energy times 0.05 in cos zenith its muons
are uniform in log E and in cos zenith, and from one cell to the next the density jumps. Here each
muon is moved inside its cell, keeping its rank there, so that the density becomes continuous while every
cell keeps its content: the cumulative distribution that passes through the same points at the cells' edges
is made a monotone spline (F. N. Fritsch and J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, as in
`scipy.interpolate.PchipInterpolator`), of its logit over log E, and, given the energy, of its logarithm over
log cos zenith. Both continue as power laws beyond the outermost edges that hold muons.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.special import logit

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import LOWEST_ENERGY
from deepmuon_training.data.cry_cells import COS_ZENITH_EDGES, ENERGY_CELL
from deepmuon_training.sample import Sample

__all__ = ["StepSmoother", "smoothed"]

_LOWEST, _HIGHEST = -20, 25  # energy cells that are kept apart: 1e-4 GeV to 1e5 GeV
_FEWEST_FOR_ANGLES = 1000  # muons under which energy cells share one distribution of angles
_POINTS_IN_CELL = 16
_LEAST_COS_ZENITH = 1e-6  # a flat power law, as few muons have it, would go on to level muons
_FAR = 60.0  # in the logarithm of a probability: beyond any sample

Float = NDArray[np.float64]


@dataclass(frozen=True)
class _EnergyMap:
    """The smooth cumulative distribution of x = log10(E/GeV), beside the stepped one."""

    edges: Float
    cumulative: Float

    @classmethod
    def fit(cls, x: Float) -> _EnergyMap:
        edges: Float = ENERGY_CELL * np.arange(_LOWEST, _HIGHEST + 1, dtype=np.float64)
        counts = np.histogram(x, edges)[0]
        cumulative = np.concatenate([[0], np.cumsum(counts)]) / counts.sum()
        return cls(edges, cumulative)

    def __call__(self, x: Float) -> Float:
        """Move each x [n] inside its cell; one outside of all filled cells, whose rank says nothing, stays."""
        rank = np.interp(x, self.edges, self.cumulative)
        known = (rank > 0) & (rank < 1)
        return np.where(known, self._smooth(np.where(known, rank, 0.5)), x)

    def quantiles(self, low: float, high: float, count: int) -> Float:
        """Smooth x at evenly spaced ranks between two edges."""
        ends = np.interp([low, high], self.edges, self.cumulative)
        return self._smooth(ends[0] + (np.arange(count) + 0.5) / count * (ends[1] - ends[0]))

    def _smooth(self, rank: Float) -> Float:
        """Invert the smooth cumulative distribution: logit F is a spline inside, linear outside."""
        inside = (self.cumulative > 0) & (self.cumulative < 1)
        inside[1:] &= np.diff(self.cumulative) > 0  # an empty cell is one with the next
        return _invert(self.edges[inside], logit(self.cumulative[inside]), logit(rank), extend=(True, True))


def _log_cumulative(counts: NDArray[np.int64], all_counts: NDArray[np.int64]) -> Float:
    """Log of the cumulative distribution at the upper edges; one muon spread as all are keeps it finite."""
    filled = counts + (all_counts + 1) / (all_counts + 1).sum()
    cumulative = np.cumsum(filled)
    log_cumulative: Float = np.log(cumulative / cumulative[-1])
    return log_cumulative


class _ZenithMap:
    """The smooth distribution of cos zenith given x = log10(E/GeV), beside the stepped one."""

    def __init__(self, x: Float, cos_zenith: Float, energy_map: _EnergyMap) -> None:
        counts = np.histogram2d(x, cos_zenith, [energy_map.edges, COS_ZENITH_EDGES])[0].astype(np.int64)
        groups = _group(counts.sum(axis=1))
        self._group_edges = energy_map.edges[[groups[0][0], *(stop for _, stop in groups)]]
        stepped = np.array([_log_cumulative(counts[a:b].sum(axis=0), counts.sum(axis=0)) for a, b in groups])
        self._stepped = np.concatenate([np.zeros((len(groups), 1)), np.exp(stepped)], axis=1)
        self._tabulate(stepped, energy_map)

    def _tabulate(self, stepped: Float, energy_map: _EnergyMap) -> None:
        """Log cos zenith over (x, t), where the rank is exp(-t^2)."""
        nodes, curves = _keep_cell_means(stepped, self._group_edges, energy_map)
        self._x = np.linspace(nodes[0], nodes[-1], 20 * len(nodes))
        self._t = np.linspace(0.0, 6.0, 601)
        log_edges = np.log(COS_ZENITH_EDGES[1:])
        self._table = np.array(
            [_invert(log_edges, _increasing(row), -(self._t**2), extend=(True, False)) for row in curves(self._x)]
        )

    def __call__(self, x: Float, cos_zenith: Float, smooth_x: Float) -> Float:
        """Move each cos zenith [n] of original log10 energy `x` to the distribution at `smooth_x`."""
        group = np.clip(np.searchsorted(self._group_edges, x, "right") - 1, 0, len(self._stepped) - 1)
        cell, inside = np.divmod(np.clip(cos_zenith, 1e-9, 1 - 1e-9) * 20, 1)
        cell = cell.astype(int)
        low, high = self._stepped[group, cell], self._stepped[group, cell + 1]
        t = np.sqrt(-np.log(low + inside * (high - low)))
        return np.maximum(np.exp(_bilinear(self._table, self._x, self._t, smooth_x, t)), _LEAST_COS_ZENITH)


def _group(counts: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Ranges of energy cells; at both ends those with few muons are taken together."""
    rich = np.flatnonzero(counts >= _FEWEST_FOR_ANGLES)
    if len(rich) < 3 or not counts[rich[0] : rich[-1]].all():
        raise RefusedError(
            f"{counts.sum():,} muons of one charge are too few to take the steps of CRY's tables out: three cells of "
            f"{ENERGY_CELL} decade in energy must hold {_FEWEST_FOR_ANGLES:,} and more, and none between them be empty"
        )
    first, last = rich[0], rich[-1]
    return [(0, first + 1), *((k, k + 1) for k in range(first + 1, last)), (last, len(counts))]


def _keep_cell_means(stepped: Float, edges: Float, energy_map: _EnergyMap) -> tuple[Float, PchipInterpolator]:
    """Curves in x through all zenith edges whose mean over each energy cell is the cell's own value.

    Returns the nodes and the curves of log F. A curve drawn through the cells' values themselves would have other means
    where it bends; a few rounds of adding the difference bring them back.
    """
    points = np.array([energy_map.quantiles(a, b, _POINTS_IN_CELL) for a, b in pairwise(edges)])
    nodes = points.mean(axis=1)
    points = np.clip(points, nodes[0], nodes[-1])
    values = stepped
    for _ in range(5):
        means = np.exp(PchipInterpolator(nodes, values)(points)).mean(axis=1)
        values = values + np.clip(stepped - np.log(means), -0.2, 0.2)
    return nodes, PchipInterpolator(nodes, values)


def _increasing(log_cumulative: Float) -> Float:
    """Return the values strictly increasing to 0: curves of neighbouring edges could touch where muons are few."""
    increasing: Float = np.maximum.accumulate(log_cumulative) + 1e-6 * np.arange(len(log_cumulative))
    to_zero: Float = increasing - increasing[-1]
    return to_zero


def _invert(x: Float, y: Float, values: Float, extend: tuple[bool, bool]) -> Float:
    """Where a monotone spline through (x, y) takes the values; straight lines go on below and above.

    In the coordinates used here a straight line is a power law.
    """
    slopes = np.diff(y) / np.diff(x)
    below = ([x[0] - _FAR / slopes[0]], [y[0] - _FAR]) if extend[0] else ([], [])
    above = ([x[-1] + _FAR / slopes[-1]], [y[-1] + _FAR]) if extend[1] else ([], [])
    spline = PchipInterpolator(np.concatenate([below[0], x, above[0]]), np.concatenate([below[1], y, above[1]]))
    grid = np.concatenate([below[0], np.linspace(x[0], x[-1], 200 * len(x)), above[0]])
    found: Float = np.interp(values, spline(grid), grid)
    return found


def _bilinear(table: Float, rows: Float, columns: Float, row: Float, column: Float) -> Float:
    """Interpolate a table over evenly spaced rows and columns, constant beyond its ends."""
    i, a = np.divmod(np.clip((row - rows[0]) / (rows[1] - rows[0]), 0, len(rows) - 1 - 1e-9), 1)
    j, b = np.divmod(np.clip((column - columns[0]) / (columns[1] - columns[0]), 0, len(columns) - 1 - 1e-9), 1)
    i, j = i.astype(int), j.astype(int)
    upper = table[i, j] * (1 - b) + table[i, j + 1] * b
    lower = table[i + 1, j] * (1 - b) + table[i + 1, j + 1] * b
    value: Float = upper * (1 - a) + lower * a
    return value


class StepSmoother:
    """Moves CRY's muons inside the cells of its tables, each charge by a map of its own.

    Parameters
    ----------
    muons : Muons
        The training part of a CRY sample; the maps are fitted on these. Where their charge is not known (pdg_id 0), one
        map is for all.

    Raises
    ------
    RefusedError
        If there are too few muons of a charge for a map.
    """

    def __init__(self, muons: Muons) -> None:
        self._maps = {}
        for pdg_id in np.unique(muons.pdg_id):
            x, cos_zenith = _coordinates(muons[muons.pdg_id == pdg_id])
            energy_map = _EnergyMap.fit(x)
            self._maps[pdg_id] = energy_map, _ZenithMap(x, cos_zenith, energy_map)

    def __call__(self, muons: Muons) -> Muons:
        """Return the smoothed muons, in the order of the originals; azimuth and charge stay.

        Raises
        ------
        RefusedError
            If there is a charge of which no map was fitted.
        """
        if not np.isin(muons.pdg_id, list(self._maps)).all():
            raise RefusedError("there are muons of a charge that those had not on which the smoothing was fitted")
        energy, cos_zenith = np.empty(len(muons)), np.empty(len(muons))
        for pdg_id, (energy_map, zenith_map) in self._maps.items():
            mine = muons.pdg_id == pdg_id
            x, c = _coordinates(muons[mine])
            smooth_x = energy_map(x)
            energy[mine] = 10**smooth_x
            cos_zenith[mine] = zenith_map(x, c, smooth_x)
        return _with(muons, energy, cos_zenith)


def smoothed(sample: Sample, smooth: StepSmoother) -> Sample:
    """Take the steps of CRY's tables out of a sample, and what moves below 1 MeV with them.

    Raises
    ------
    RefusedError
        As `StepSmoother` when it is called.
    """
    muons = smooth(sample.muons)
    kept = muons.kinetic_energy >= LOWEST_ENERGY
    return sample.then(
        f"steps of CRY's tables taken out, {np.sum(~kept)} muons moved below 1 MeV dropped",
        muons=muons[kept],
        rate=None if sample.rate is None else sample.rate * float(np.mean(kept)),
        smoothed=True,
    )


def _coordinates(muons: Muons) -> tuple[Float, Float]:
    """Log10 of the energy in GeV, and cos zenith."""
    return np.log10(muons.kinetic_energy.astype(np.float64)), muons.cos_zenith.astype(np.float64)


def _with(muons: Muons, energy: Float, cos_zenith: Float) -> Muons:
    """Copy muons with other energies and zenith angles, at the azimuth they have."""
    u, v = muons.u.astype(np.float64), muons.v.astype(np.float64)
    stretch = np.sqrt((1 - cos_zenith) * (1 + cos_zenith)) / np.maximum(np.hypot(u, v), 1e-12)
    return Muons.of(energy, u * stretch, v * stretch, -cos_zenith, muons.pdg_id)
