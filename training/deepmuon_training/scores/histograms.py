"""Scores of counted muons: cells of energy and zenith, energy bins, tails, charge.

Throughout, p are counts of n generated muons, q of m held-out ones, s = n / m, and V is how many times larger than that
of independent muons the variance of the held-out counts is (1 unless stated). The noise is that of independent
generated muons; those of one transformer draw are not, and their counts may fluctuate less or more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.muons import Muons
from deepmuon_training.data.cry_cells import COS_ZENITH_EDGES
from deepmuon_training.scores.chi_square import ChiSquare

__all__ = [
    "ENERGY_EDGES",
    "ZENITH_EDGES",
    "Bin",
    "CellScore",
    "TailScore",
    "compare_cells",
    "compare_charge",
    "compare_cos_zenith",
    "compare_energy_bins",
    "compare_horizon",
    "compare_tails",
    "compare_zenith_bins",
    "count_muons",
]

ENERGY_EDGES = 10.0 ** np.linspace(-2, 3, 51)
"""Edges of the energy bins [GeV], ten to a decade; every second one is an edge of CRY's cells."""

ZENITH_EDGES = np.linspace(0, 90, 46)
"""Edges of the zenith bins [degrees], two degrees wide."""

_CHUNK = 1 << 20  # muons counted at a time: bounds the memory
_FEWEST_IN_CELL = 10  # expected muons under which a cell is left out
_FEWEST_IN_BIN = 10_000  # muons under which a bin is left out
_HORIZON = 4  # CRY's cells in cos zenith, from the horizon up to 0.2, of which each is a score of its own

Counts = NDArray[np.int64]


@dataclass(frozen=True)
class CellScore:
    """Comparison on CRY's cells, 0.2 decade in energy times 0.05 in cos zenith.

    Parameters
    ----------
    chi_square : ChiSquare
        sum (p - s q)^2 / (s (p + q) (1 + s V) / (1 + s)) over cells with 10 and more expected in the smaller sample.
    delta : float
        sqrt(max(0, chi2 - ndf) (1/n + V/m)): the relative difference, weighted by content, beyond noise.
    delta_noise : float
        The delta that noise of one standard deviation feigns.
    """

    chi_square: ChiSquare
    delta: float
    delta_noise: float


@dataclass(frozen=True)
class Bin:
    """One bin: edges [GeV or degrees], counts, p / (s q) - 1, its error sqrt(1/p + V/q), and their quotient."""

    low: float
    high: float
    generated: int
    held_out: int
    deviation: float
    error: float
    pull: float


@dataclass(frozen=True)
class TailScore:
    """Muons in one tail: found p, expected s q, error sqrt(s (p + q) (1 + s V) / (1 + s)), difference in errors."""

    name: str
    found: int
    expected: float
    error: float
    pull: float


def count_muons(muons: Muons) -> Counts:
    """Count muons by charge, energy and cos zenith: int64 [2, 52, 20].

    First axis: mu-, mu+. Second: below 0.01 GeV, the 50 bins of `ENERGY_EDGES`, above 1 TeV. Third:
    CRY's cells in cos zenith.
    """
    shape = (2, len(ENERGY_EDGES) + 1, len(COS_ZENITH_EDGES) - 1)
    counts = np.zeros(np.prod(shape), np.int64)
    for start in range(0, len(muons), _CHUNK):
        part = muons[start : start + _CHUNK]
        positive = (part.charge > 0).astype(np.intp)
        energy = np.digitize(part.kinetic_energy, ENERGY_EDGES)
        zenith = np.digitize(part.cos_zenith, COS_ZENITH_EDGES[1:-1])
        counts += np.bincount(np.ravel_multi_index((positive, energy, zenith), shape), minlength=len(counts))
    return counts.reshape(shape)


def _cry_cells(counts: Counts) -> Counts:
    """Join neighbouring energy bins to CRY's: [2, 52, 20] to [2, 27, 20]."""
    pairs = counts[:, 1:-1].reshape(2, -1, 2, counts.shape[2]).sum(axis=2)
    return np.concatenate([counts[:, :1], pairs, counts[:, -1:]], axis=1)


def compare_cells(generated: Counts, held_out: Counts, variance: float = 1.0) -> CellScore:
    """Compare two tables of `count_muons` on CRY's cells, both charges together."""
    p, q = (_cry_cells(counts).sum(axis=0).ravel() for counts in (generated, held_out))
    n, m = int(p.sum()), int(q.sum())
    s = n / m
    used = (p + q) * (min(n, m) / (n + m)) >= _FEWEST_IN_CELL
    p, q = p[used], q[used]
    chi_square = ChiSquare.of(np.sum((p - s * q) ** 2 / _difference_variance(p + q, s, variance)), max(len(p) - 1, 0))
    weight = 1 / n + variance / m
    return CellScore(
        chi_square=chi_square,
        delta=sqrt(max(0.0, chi_square.chi2 - chi_square.ndf) * weight),
        delta_noise=sqrt(sqrt(2 * chi_square.ndf) * weight),
    )


def _difference_variance(both: Any, s: float, variance: float) -> Any:
    """Variance of p - s q where p + q are `both` and nothing differs."""
    return s * both * (1 + s * variance) / (1 + s)


def compare_energy_bins(generated: Counts, held_out: Counts, variance: float = 1.0) -> tuple[Bin, ...]:
    """Compare two tables of `count_muons` in energy bins that hold 10,000 and more muons of both."""
    p, q = (counts.sum(axis=(0, 2))[1:-1] for counts in (generated, held_out))
    return _compare_bins(ENERGY_EDGES, p, q, float(generated.sum() / held_out.sum()), variance)


def compare_zenith_bins(generated: Muons, held_out: Muons, variance: float = 1.0) -> tuple[Bin, ...]:
    """Compare the zenith angles in bins of two degrees that hold 10,000 and more muons of both.

    These are finer than CRY's cells near the vertical, where imaging needs the muons' density. Near the horizon there
    are none, see `compare_horizon`.
    """
    return _compare_bins(
        ZENITH_EDGES, _count_zenith(generated), _count_zenith(held_out), len(generated) / len(held_out), variance
    )


def compare_cos_zenith(generated: Sequence[int], held_out: Sequence[int], variance: float = 1.0) -> tuple[Bin, ...]:
    """Compare counts by CRY's cells in cos zenith [20], above the horizon's, that hold 10,000 and more of both."""
    s = sum(generated) / sum(held_out)
    p, q = np.array(generated), np.array(held_out)
    return _compare_bins(COS_ZENITH_EDGES[_HORIZON:], p[_HORIZON:], q[_HORIZON:], s, variance)


def compare_horizon(generated: Sequence[int], held_out: Sequence[int], variance: float = 1.0) -> tuple[TailScore, ...]:
    """Compare counts by CRY's cells in cos zenith [20] in each of the four nearest to the horizon, however few."""
    s = sum(generated) / sum(held_out)
    edges = COS_ZENITH_EDGES[: _HORIZON + 1]
    names = [f"cos zenith {low:.2g} to {high:.2g}" for low, high in pairwise(edges)]
    return tuple(_compare_tail(name, p, q, s, variance) for name, p, q in zip(names, generated, held_out, strict=False))


def _count_zenith(muons: Muons) -> Counts:
    counts = np.zeros(len(ZENITH_EDGES) - 1, np.int64)
    for start in range(0, len(muons), _CHUNK):
        part = muons[start : start + _CHUNK]
        zenith = np.degrees(np.arctan2(np.hypot(part.u, part.v), part.cos_zenith))
        counts += np.histogram(zenith, ZENITH_EDGES)[0]
    return counts


def _compare_bins(
    edges: NDArray[np.float64], generated: Counts, held_out: Counts, s: float, variance: float
) -> tuple[Bin, ...]:
    bins = []
    for low, high, p, q in zip(edges[:-1], edges[1:], generated.tolist(), held_out.tolist(), strict=True):
        if min(p, q) >= _FEWEST_IN_BIN:
            deviation, error = p / (s * q) - 1, sqrt(1 / p + variance / q)
            bins.append(Bin(float(low), float(high), p, q, deviation, error, deviation / error))
    return tuple(bins)


def _tails(muons: Muons) -> dict[str, int]:
    energy, cos_zenith = muons.kinetic_energy, muons.cos_zenith
    return {
        "above 100 GeV": int(np.count_nonzero(energy > 100)),
        "above 300 GeV": int(np.count_nonzero(energy > 300)),
        "above 1 TeV": int(np.count_nonzero(energy > 1000)),
        "below 20 MeV": int(np.count_nonzero(energy < 0.02)),
        "cos zenith below 0.2": int(np.count_nonzero(cos_zenith < 0.2)),
    }


def compare_tails(generated: Muons, held_out: Muons, variance: float = 1.0) -> tuple[TailScore, ...]:
    """Compare how many muons lie in each tail; the error is the one of both samples being alike."""
    s = len(generated) / len(held_out)
    q = _tails(held_out)
    return tuple(_compare_tail(name, p, q[name], s, variance) for name, p in _tails(generated).items())


def _compare_tail(name: str, p: int, q: int, s: float, variance: float) -> TailScore:
    error = sqrt(_difference_variance(p + q, s, variance))
    return TailScore(name, p, s * q, error, (p - s * q) / error if error else 0.0)


def compare_charge(generated: Counts, held_out: Counts) -> ChiSquare:
    """Compare the fraction of mu+ in each of CRY's cells, whatever the cells' contents.

    Each cell with 10 and more expected of each charge in the smaller sample adds
    (f_p - f_q)^2 / (f (1 - f) (1/p + 1/q)), f being the fraction in both together.
    """
    p, q = _cry_cells(generated), _cry_cells(held_out)
    n, m = int(p.sum()), int(q.sum())
    used = ((p + q) * (min(n, m) / (n + m)) >= _FEWEST_IN_CELL).all(axis=0)
    used &= (p.sum(axis=0) > 0) & (q.sum(axis=0) > 0)
    p, q = p[:, used], q[:, used]
    p_all, q_all = p.sum(axis=0), q.sum(axis=0)
    f = (p[1] + q[1]) / (p_all + q_all)
    difference = p[1] / p_all - q[1] / q_all
    return ChiSquare.of(np.sum(difference**2 / (f * (1 - f) * (1 / p_all + 1 / q_all))), len(f))
