"""The flux through a sphere, from the map of the flux through a horizontal plane.

A horizontal plane sees J cos zenith, a sphere sees J from everywhere: its muons have the plane's density divided by
cos zenith, and its rate, per m2 of projected area, is the plane's times the mean of 1 / cos zenith. The map of the
new density is the old one at other levels, found by integrals of the old map itself, in double precision.

Near the horizon 1 / cos zenith asks for what few muons have shown. There the map is a power of its level, as it was
fitted: with cos zenith going as the power a, the flux J from a direction goes as cos zenith^(1/a - 2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.special import expit

__all__ = ["TriangularMap", "through_sphere"]

_FINE = 32
"""Steps of the integral over the zenith, to a column."""

_BEYOND = 40.0
"""Logit of the level to which the zenith's map is continued: where 1 / cos zenith grows, its far end counts."""

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class TriangularMap:
    """Energy by its level, and zenith and charge by the zenith's level, for some energies.

    Parameters
    ----------
    t : [n]
        Logits of the energy's level.
    energy : [n]
        ln E over these.
    row : [n]
        Place of each of these t among the rows, 0 to r - 1.
    row_t : [r]
        t of each row.
    column : [c]
        Logits of the zenith's level.
    zenith, charge : [r, c]
        Logit cos zenith and 2 P(mu+) - 1.
    least_cosine
        No cos zenith is less.
    """

    t: Float64
    energy: Float64
    row: Float64
    row_t: Float64
    column: Float64
    zenith: Float64
    charge: Float64
    least_cosine: float


def through_sphere(plane: TriangularMap) -> tuple[Float64, Float64, Float64, float]:
    """Return energy [n], zenith and charge [r, c] of the sphere's map, and the mean of 1 / cos zenith."""
    rows = np.arange(len(plane.row_t))
    means = np.array([_Levels.of(plane, zenith).mean for zenith in plane.zenith])
    levels, mean = _weighted(plane.t, np.interp(plane.row, rows, means))
    energy = np.interp(np.interp(plane.t, levels, plane.t), plane.t, plane.energy)
    place = np.interp(np.interp(plane.row_t, levels, plane.t), plane.t, plane.row)
    zenith, charge = np.empty_like(plane.zenith), np.empty_like(plane.charge)
    for number, at in enumerate(place):
        row = _between(plane.zenith, at)
        old = _Levels.of(plane, row).old_of(plane.column)
        zenith[number] = _curve(plane.column, row)(old)
        charge[number] = np.interp(old, plane.column, _between(plane.charge, at))
    return energy, zenith, charge, mean


def _between(table: Float64, place: float) -> Float64:
    """Return the row at a place between rows."""
    low = min(int(place), len(table) - 2)
    between: Float64 = table[low] + (place - low) * (table[low + 1] - table[low])
    return between


@dataclass(frozen=True)
class _Levels:
    """Logits of levels before and after the weights of one row, and the mean weight."""

    before: Float64
    after: Float64
    mean: float

    @classmethod
    def of(cls, plane: TriangularMap, zenith: Float64) -> _Levels:
        step = (plane.column[1] - plane.column[0]) / _FINE
        before = np.linspace(-_BEYOND, _BEYOND, 2 * int(_BEYOND / step) + 1)
        cosine = np.maximum(expit(_curve(plane.column, zenith)(before)), plane.least_cosine)
        return cls(before, *_weighted(before, 1 / cosine))

    def old_of(self, logits: Float64) -> Float64:
        """Return the old levels of new ones."""
        return np.interp(logits, self.after, self.before)


def _curve(column: Float64, zenith: Float64) -> CubicHermiteSpline:
    """Return a row as muons have it, a cubic through four columns; beyond, cos zenith is a power of the level."""
    slope = np.gradient(zenith, column)
    low, high = -_BEYOND - column[0], _BEYOND - column[-1]
    ends = zenith[0] + low * slope[0], zenith[-1] + high * slope[-1]
    return CubicHermiteSpline([-_BEYOND, *column, _BEYOND], [ends[0], *zenith, ends[1]], [slope[0], *slope, slope[-1]])


def _weighted(logit: Float64, weight: Float64) -> tuple[Float64, float]:
    """Return the logits of levels with a weight, and the weight's mean: what is beyond the ends has theirs."""
    upper = logit[:-1] + logit[1:] > 0  # where a level is near 1, its distance from 1 has the digits
    share = np.where(upper, -np.diff(expit(-logit)), np.diff(expit(logit)))
    parts = np.array(
        [
            expit(logit[0]) * weight[0],
            *(share * (weight[:-1] + weight[1:]) / 2),
            expit(-logit[-1]) * weight[-1],
        ]
    )
    below, above = np.cumsum(parts)[:-1], np.cumsum(parts[::-1])[-2::-1]
    return np.log(below / above), float(parts.sum())
