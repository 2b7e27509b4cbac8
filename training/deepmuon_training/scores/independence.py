"""Independence of each generated muon of its position and of its neighbours.

The quantile generator's muons are, by construction, and every score is near 0 sigma. A transformer's
draw is a stratified set of muons, and its scores say how correlated: a negative sigma of the block means is a
draw more even than independent muons are, which a simulation that treats them as independent will not know.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.scores.chi_square import ChiSquare

__all__ = [
    "Autocorrelation",
    "BlockMeans",
    "Independence",
    "Repeats",
    "VarianceShare",
    "count_repeated",
    "measure_independence",
]

_NOMINAL_PERIOD = 128  # where each draw is one muon: any would do, SIMD and batch sizes are powers of two
_ENERGY_BINS = 20
_FEWEST_AT_POSITION = 200  # muons under which neighbouring positions are counted together: 10 in a bin
_FEWEST_DRAWS = 100
_LAGS = range(1, 9)
_FEWEST_BLOCKS = 30_000
_SHORT_BLOCK = 16
_CELL_BITS = 13  # float32 values that follow one another, 8192 to a cell, are taken as equally likely

Float = NDArray[np.float64]


@dataclass(frozen=True)
class VarianceShare:
    """Share of a column's variance that lies between positions.

    `expected` and `noise` are mean and standard deviation for independent muons.
    """

    column: str
    share: float
    expected: float
    noise: float
    sigma: float


@dataclass(frozen=True)
class Autocorrelation:
    """Correlation of a column with itself `lag` muons later; its noise is 1/sqrt(n)."""

    column: str
    lag: int
    correlation: float
    noise: float
    sigma: float


@dataclass(frozen=True)
class BlockMeans:
    """Variance of the means of `blocks` blocks of `length` muons in a row.

    `ratio` is the variance times length, over the variance of single muons: 1 for independent muons. In a
    random permutation of the same muons only the products of different muons of a block vary, which gives the
    noise sqrt(2 (1 - 1/length) / blocks) whatever the column's distribution.
    """

    column: str
    length: int
    blocks: int
    ratio: float
    noise: float
    sigma: float


@dataclass(frozen=True)
class Repeats:
    """Muons that repeat an earlier one.

    Parameters
    ----------
    muons : int
        Muons equal to an earlier one in all columns, bit by bit; rounding explains none.
    energies : int
        Muons whose energy is that of an earlier one.
    energies_expected, energies_noise : float
        How many of these rounding to float32 explains, with its standard deviation, from the number of
        float32 values where the muons lie (balls in boxes: W. Feller, An Introduction to Probability Theory
        and Its Applications, vol. 1, IV.2).
    energies_ratio : float
        energies / energies_expected. An energy computed as a ninth power in float32 takes only about every
        ninth float32 value: up to 12 for an honest generator.
    """

    muons: int
    energies: int
    energies_expected: float
    energies_noise: float
    energies_ratio: float


@dataclass(frozen=True)
class Independence:
    """All scores of the generated sequence.

    Parameters
    ----------
    period : int
        Positions looked at: muons per draw, or a nominal 128 (`period_is_nominal`) where a draw is one muon.
    positions : ChiSquare
        Homogeneity of position in a draw times 20 equally filled energy bins.
    variance_between_positions, autocorrelations, block_means : tuple
        Of log10 E and cos zenith; a column that never varies is left out.
    repeats : Repeats
    """

    period: int
    period_is_nominal: bool
    positions: ChiSquare
    variance_between_positions: tuple[VarianceShare, ...]
    autocorrelations: tuple[Autocorrelation, ...]
    block_means: tuple[BlockMeans, ...]
    repeats: Repeats


def measure_independence(muons: Muons, muons_per_draw: int = 1) -> Independence:
    """Measure the independence of a generated sequence, in the order in which it was made.

    Parameters
    ----------
    muons
        The sequence, beginning with a whole draw.
    muons_per_draw
        Muons that the generator makes together.

    Raises
    ------
    RefusedError
        For fewer than 100 whole draws (or periods), or no muon per draw.
    """
    if muons_per_draw < 1:
        raise RefusedError(f"muons_per_draw is {muons_per_draw}, expected at least 1")
    period = muons_per_draw if muons_per_draw > 1 else _NOMINAL_PERIOD
    if len(muons) < _FEWEST_DRAWS * period:
        raise RefusedError(f"{len(muons)} muons are too few for {period} positions, need {_FEWEST_DRAWS * period}")
    columns = {
        name: standard
        for name, values in (("log10 E", np.log10(muons.kinetic_energy)), ("cos zenith", muons.cos_zenith))
        if (standard := _standardised(values)) is not None
    }
    position = _positions(len(muons), period)
    return Independence(
        period=period,
        period_is_nominal=muons_per_draw == 1,
        positions=_compare_positions(muons.kinetic_energy, position),
        variance_between_positions=tuple(_variance_share(name, x, position) for name, x in columns.items()),
        autocorrelations=tuple(_autocorrelation(name, x, lag) for name, x in columns.items() for lag in _LAGS),
        block_means=tuple(
            _block_means(name, x, length) for name, x in columns.items() for length in _lengths(len(muons), period)
        ),
        repeats=_count_repeats(muons),
    )


def _standardised(values: NDArray[np.float32]) -> Float | None:
    """Values with mean 0 and variance 1; None for a constant."""
    x = values.astype(np.float64)
    x -= x.mean()
    spread = sqrt(float(x @ x) / len(x))
    return x / spread if spread > 0 else None


def _positions(n: int, period: int) -> NDArray[np.int64]:
    """Position of each of n muons in its draw; neighbours are joined where a position has few muons."""
    joined = max(1, min(period, n // _FEWEST_AT_POSITION))
    position: NDArray[np.int64] = np.arange(n) % period * joined // period
    return position


def _compare_positions(energy: NDArray[np.float32], position: NDArray[np.int64]) -> ChiSquare:
    """Chi-square of homogeneity of the positions' energy spectra."""
    edges = np.unique(np.quantile(energy, np.arange(1, _ENERGY_BINS) / _ENERGY_BINS))
    cell = position * _ENERGY_BINS + np.searchsorted(edges, energy)
    counts = np.bincount(cell, minlength=(int(position.max()) + 1) * _ENERGY_BINS).reshape(-1, _ENERGY_BINS)
    counts = counts[:, counts.any(axis=0)]
    expected = counts.sum(axis=1, keepdims=True) * counts.sum(axis=0) / len(energy)
    return ChiSquare.of(np.sum((counts - expected) ** 2 / expected), (counts.shape[0] - 1) * (counts.shape[1] - 1))


def _variance_share(name: str, x: Float, position: NDArray[np.int64]) -> VarianceShare:
    """Find the share of a standardised column's variance between positions, a chi-square of their means."""
    sizes = np.bincount(position)
    sums = np.bincount(position, weights=x)
    share = float(np.sum(sums**2 / sizes) / len(x))
    ndf = len(sizes) - 1
    sigma = ChiSquare.of(share * len(x), ndf).sigma
    return VarianceShare(name, share, ndf / len(x), sqrt(2 * ndf) / len(x), sigma or 0.0)


def _autocorrelation(name: str, x: Float, lag: int) -> Autocorrelation:
    correlation, noise = float(x[:-lag] @ x[lag:]) / len(x), 1 / sqrt(len(x))
    return Autocorrelation(name, lag, correlation, noise, correlation / noise)


def _lengths(n: int, period: int) -> list[int]:
    """Lengths of the blocks: short ones, whole draws, and the longest of which there are enough."""
    longest = n // _FEWEST_BLOCKS
    return sorted({length for length in (_SHORT_BLOCK, period, longest) if 2 <= length <= longest})


def _block_means(name: str, x: Float, length: int) -> BlockMeans:
    blocks = len(x) // length
    means = x[: blocks * length].reshape(blocks, length).mean(axis=1)
    ratio, noise = float(means @ means) / blocks * length, sqrt(2 * (1 - 1 / length) / blocks)
    return BlockMeans(name, length, blocks, ratio, noise, (ratio - 1) / noise)


def _count_repeats(muons: Muons) -> Repeats:
    bits = muons.kinetic_energy.view(np.uint32)
    energies = _repeated(bits.copy())
    balls = np.bincount(bits >> _CELL_BITS).astype(np.float64)
    balls, boxes = balls[balls > 0], float(1 << _CELL_BITS)
    empty = boxes * np.exp(balls * np.log1p(-1 / boxes))  # on average, of the boxes of each cell
    expected = float(np.sum(balls - (boxes - empty)))
    still_empty = boxes * (boxes - 1) * np.exp(balls * np.log1p(-2 / boxes))  # pairs of empty boxes
    variance = float(np.sum(np.maximum(still_empty + empty - empty**2, 0)))
    return Repeats(count_repeated(muons), energies, expected, sqrt(variance), energies / max(expected, 1.0))


def count_repeated(muons: Muons) -> int:
    """Return how many muons are equal to an earlier one in all columns, bit by bit."""
    return _repeated(_fingerprints(muons))


def _repeated(values: NDArray[np.unsignedinteger]) -> int:
    """Values that are equal to an earlier one; sorts them in place."""
    values.sort()
    return int(np.count_nonzero(values[1:] == values[:-1]))


def _fingerprints(muons: Muons) -> NDArray[np.uint64]:
    """One 64-bit number per muon, equal for equal muons, and for others once in 1.8e19 pairs.

    Each column is multiplied in turn by the odd constant of D. Knuth's golden ratio, and folded.
    """
    mixed = np.zeros(len(muons), np.uint64)
    for column in (muons.kinetic_energy, muons.u, muons.v, muons.w):
        mixed ^= column.view(np.uint32)
        mixed *= np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(32)
    mixed ^= muons.pdg_id.view(np.uint8)
    return mixed * np.uint64(0x9E3779B97F4A7C15)
