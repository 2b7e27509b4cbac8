"""Smooth functions of one or two variables, learned from counts by penalised likelihood: densities, probabilities.

The logarithm of a density, or the logit of a probability, is a sum of products of cubic B-splines on even knots. What
is made large is the likelihood of the counts less a penalty on second differences of neighbouring coefficients (P. H.
C. Eilers and B. D. Marx, Stat. Sci. 11 (1996) 89): where nothing is counted, the function goes on as a straight line,
which for a density over a logarithm is a power law. There are as many knots as any structure needs; how much of it the
counts bear out is found with them, one penalty for each variable, by the iteration of S. N. Wood and M. Fasiolo
(Biometrics 73 (2017) 1071). All is linear algebra on counts, as quick for a hundred million muons as for a thousand
(I. D. Currie, M. Durban and P. H. C. Eilers, J. R. Stat. Soc. B 68 (2006) 259), with one solution and no randomness.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.special import expit, logit

from deepmuon_runtime.errors import FailedError

__all__ = ["BINS_PER_INTERVAL", "Axis", "Surface", "fit_log_density", "fit_logit"]

BINS_PER_INTERVAL = 4
"""Bins of the counts, to an interval between knots."""

_MOST_STEPS = 60
_SETTLED, _NEARLY = 0.01, 0.1  # of the statistical error: steps that move the function by less are the last ones
_SETTLED_FREEDOM = 0.005  # relative change of the degrees of freedom
_LARGEST_STEP = 3.0  # of a coefficient, while the likelihood is far from a parabola
_PENALTIES = 0.1, 1e6
_RIDGE = 1e-6  # of a count: keeps what nothing was counted of from being singular
_FASTEST = 20.0  # factor of a penalty in a step

Float = NDArray[np.float64]


@dataclass(frozen=True)
class Axis:
    """Even knots of one variable.

    Parameters
    ----------
    low, high
        Outermost knots.
    intervals
        Between them; 0 for a variable on which nothing depends.
    """

    low: float
    high: float
    intervals: int

    @property
    def bins(self) -> int:
        """Number of bins in which a fit counts."""
        return max(1, BINS_PER_INTERVAL * self.intervals)

    @property
    def edges(self) -> Float:
        """Edges of these bins."""
        return np.linspace(self.low, self.high, self.bins + 1)

    @property
    def middles(self) -> Float:
        """Their middles."""
        edges = self.edges
        middles: Float = (edges[1:] + edges[:-1]) / 2
        return middles

    def bin_of(self, x: Float) -> NDArray[np.intp]:
        """Return the bin of each x; what is beyond an end is in the last one there."""
        place = (x - self.low) * (self.bins / (self.high - self.low))
        return np.clip(place, 0, self.bins - 1).astype(np.intp)

    def basis(self, x: Float) -> Float:
        """Return the B-splines at x [n]: [n, intervals + 3]; straight lines go on beyond the ends."""
        if self.intervals == 0:
            return np.ones((len(x), 1))
        step = (self.high - self.low) / self.intervals
        inside = np.clip(x, self.low, self.high)
        place = (inside - self.low) / step
        first = np.minimum(place.astype(np.intp), self.intervals - 1)
        b = place - first
        a, beyond = 1 - b, (x - inside) / step
        values = a**3 / 6, (3 * b**3 - 6 * b**2 + 4) / 6, (3 * a**3 - 6 * a**2 + 4) / 6, b**3 / 6
        slopes = -(a**2) / 2, (3 * b**2 - 4 * b) / 2, (4 * a - 3 * a**2) / 2, b**2 / 2
        basis = np.zeros((len(x), self.intervals + 3))
        for number, (value, slope) in enumerate(zip(values, slopes, strict=True)):
            basis[np.arange(len(x)), first + number] = value + beyond * slope
        return basis


@dataclass(frozen=True)
class Surface:
    """A function of two variables.

    Parameters
    ----------
    x, y
        Their knots.
    coefficients : [x.intervals + 3, y.intervals + 3]
        Of the products of B-splines; one where there are no intervals.
    """

    x: Axis
    y: Axis
    coefficients: Float

    def __call__(self, x: Float, y: Float) -> Float:
        """Return the function at x [n] times y [m]: [n, m]."""
        found: Float = self.x.basis(x) @ self.coefficients @ self.y.basis(y).T
        return found

    def at(self, x: Float, y: Float) -> Float:
        """Return the function at each pair of x [n] and y [n]: [n]."""
        found: Float = ((self.x.basis(x) @ self.coefficients) * self.y.basis(y)).sum(axis=1)
        return found


def fit_log_density(axes: tuple[Axis, Axis], counts: Float, exposure: Float) -> Surface:
    """Fit the logarithm of a density to the counts in bins: they are Poisson numbers of mean density x exposure.

    Parameters
    ----------
    axes
        Knots of both variables.
    counts, exposure : [bins of x, bins of y]
        What was counted, and what would be at a density of 1.
    """
    start = float(np.log(counts.sum() / exposure.sum()))

    def newton(eta: Float) -> tuple[Float, Float]:
        mean = exposure * np.exp(eta)
        return mean, counts - mean

    return _fit(axes, newton, start)


def fit_logit(axes: tuple[Axis, Axis], counts: Float, trials: Float) -> Surface:
    """Fit the logit of a probability to the counts in bins: of so many trials. The mean probability is that counted.

    Parameters
    ----------
    axes
        Knots of both variables.
    counts, trials : [bins of x, bins of y]
        How many succeeded, of how many.
    """
    start = float(logit(counts.sum() / trials.sum()))

    def newton(eta: Float) -> tuple[Float, Float]:
        probability = expit(eta)
        return trials * probability * (1 - probability), counts - trials * probability

    return _fit(axes, newton, start)


def _fit(axes: tuple[Axis, Axis], newton: Callable[[Float], tuple[Float, Float]], start: float) -> Surface:
    """Maximise a penalised likelihood.

    Parameters
    ----------
    axes
        Knots of both variables.
    newton
        Gives the likelihood's curvature and slope in each bin, of the function's values there.
    start
        The function to begin with.
    """
    bases = [axis.basis(axis.middles) for axis in axes]
    squares = [(basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1) for basis in bases]
    sizes = [basis.shape[1] for basis in bases]
    coefficients, penalties = np.full(sizes, start), _Penalties.of(*sizes)
    eta, freedom, moved = np.full([len(basis) for basis in bases], start), np.inf, np.inf
    for _ in range(_MOST_STEPS):
        curvature, slope = newton(eta)
        products = (squares[0].T @ curvature @ squares[1]).reshape(sizes[0], sizes[0], sizes[1], sizes[1])
        hessian = products.transpose(0, 2, 1, 3).reshape(coefficients.size, coefficients.size)
        ridge = _RIDGE * np.eye(coefficients.size)
        factor = cho_factor(hessian + penalties.matrix + ridge, lower=True, overwrite_a=True)
        target = cho_solve(factor, (bases[0].T @ (curvature * eta + slope) @ bases[1]).ravel())
        step = target.reshape(sizes) - coefficients
        length = float(np.abs(step).max())
        coefficients += step * min(1.0, _LARGEST_STEP / length) if length else step
        before, eta = eta, bases[0] @ coefficients @ bases[1].T
        inverse = cho_solve(factor, np.eye(coefficients.size), overwrite_b=True)
        last, freedom = freedom, float(np.sum(inverse * hessian))
        moved = float(np.sum(curvature * (eta - before) ** 2))
        if moved < _SETTLED**2 * freedom and abs(freedom - last) < _SETTLED_FREEDOM * freedom:
            break
        penalties = penalties.better(inverse, coefficients.ravel())
    # Where a distribution has a spike, as of muons in one direction, it grows narrower without an end.
    if not moved < _NEARLY**2 * freedom:
        raise FailedError(
            f"a density was not found in {_MOST_STEPS} steps: its sample is like none that was thought of"
        )
    return Surface(*axes, coefficients)


@dataclass(frozen=True)
class _Penalties:
    """The penalty on each variable's second differences: its matrix, its eigenvalues, and how heavy it is."""

    matrices: tuple[Float, Float]
    eigenvalues: tuple[Float, Float]
    weights: tuple[float, float] = (1.0, 1.0)

    @classmethod
    def of(cls, *sizes: int) -> _Penalties:
        first, second = (np.diff(np.eye(size), 2, axis=0) for size in sizes)
        first, second = first.T @ first, second.T @ second
        # The two commute: in the basis of the products of eigenvectors both are diagonal.
        values = [np.clip(np.linalg.eigvalsh(matrix), 0, None) for matrix in (first, second)]
        values = [np.where(one < 1e-9, 0, one) for one in values]
        along_x, along_y = np.kron(first, np.eye(sizes[1])), np.kron(np.eye(sizes[0]), second)
        eigenvalues: tuple[Float, Float] = np.repeat(values[0], sizes[1]), np.tile(values[1], sizes[0])
        return cls((along_x.astype(np.float64), along_y.astype(np.float64)), eigenvalues)

    @property
    def matrix(self) -> Float:
        """The sum of both."""
        total: Float = self.weights[0] * self.matrices[0] + self.weights[1] * self.matrices[1]
        return total

    def better(self, inverse: Float, coefficients: Float) -> _Penalties:
        """Return the penalties with which these coefficients, of that covariance, are likelier."""
        total = self.weights[0] * self.eigenvalues[0] + self.weights[1] * self.eigenvalues[1]
        used = total > 0
        weights = []
        for weight, matrix, values in zip(self.weights, self.matrices, self.eigenvalues, strict=True):
            expected = float(np.sum(values[used] / total[used]) - np.sum(inverse * matrix))
            found = float(coefficients @ matrix @ coefficients)
            factor = np.clip(expected / found, 1 / _FASTEST, _FASTEST) if found > 0 and expected > 0 else _FASTEST
            weights.append(float(np.clip(weight * factor, *_PENALTIES)))
        return _Penalties(self.matrices, self.eigenvalues, (weights[0], weights[1]))
