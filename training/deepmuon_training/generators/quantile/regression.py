"""Regression of monotone maps on empirical quantile functions.

The squared difference of two quantile functions, integrated over the level, is the squared Wasserstein distance of
their distributions in one dimension. Each difference is weighted by the inverse variance of the empirical quantile,
n u (1 - u) / s'^2 with n muons, level u and slope s' over the level's logit (R. Koenker, "Quantile regression",
Cambridge 2005, section 4.2). When to stop, the pinball loss of other muons says, without bins and at all levels.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import expit, logit

from deepmuon_runtime.errors import FailedError
from deepmuon_training.generators.quantile.pinball import pinball_loss
from deepmuon_training.learning.checkpoint import Checkpoint, fingerprint
from deepmuon_training.learning.monotone import ConditionalMonotoneMap, MonotoneMap
from deepmuon_training.progress import progress_bar
from deepmuon_training.ranges import Range, check_ranges

__all__ = ["RegressionSteps", "regress", "regress_conditional"]

_POINTS, _SLOPE_POINTS = 4001, 81
_LEVELS = np.linspace(-11, 11, 89)  # logit of the levels at which conditional quantiles are compared
_REACH = 9  # the bins of the condition lie between minus and plus this, in the logit of its level
_NARROWEST, _WIDTH_BY_ROOT = 0.1, 62.0  # width; of n muons a bin in the middle holds 16 sqrt(n), or 1/40 of them
_FEWEST_IN_BIN, _FEWEST_BEYOND = 50, 5
_FLATTEST = 0.05
_LEVELS_OF_MUON = 4
_LOOKS = 15  # while Adam runs: of a few thousand muons it learns the noise before it has done
_NEGLIGIBLE = 2e-5  # relative; between rounds of L-BFGS on millions of muons the loss goes up and down by less
_GOLDEN = (np.sqrt(5) - 1) / 2  # its multiples are spread evenly over (0, 1)

Float = NDArray[np.float64]


def regress(network: MonotoneMap, values: Float, tail: float) -> None:
    """Fit a map without condition to values [n], at levels between `tail` and 1 - `tail`; exact, see `solve`."""
    edge = logit(1 - tail)
    level = np.linspace(-edge, edge, _POINTS)
    quantiles = np.quantile(values, expit(level), method="hazen")
    coarse = np.linspace(-edge, edge, _SLOPE_POINTS)
    slope = np.interp(level, coarse, np.gradient(np.interp(coarse, level, quantiles), coarse))
    network.solve(level, quantiles, np.sqrt(expit(level) * expit(-level)) / slope)


@dataclass(frozen=True)
class RegressionSteps:
    """How long a conditional map is fitted.

    Parameters
    ----------
    adam
        Steps of Adam, which finds the neighbourhood of the solution.
    round
        Steps of L-BFGS between two looks at the validation loss.
    rounds
        How many such rounds at most.
    patience
        Stop after so many rounds in a row with a larger loss than the smallest one.

    Raises
    ------
    RefusedError
        If a value is out of its range.
    """

    adam: Annotated[int, Range(0, 10_000_000)] = 1500
    round: Annotated[int, Range(1, 1_000_000)] = 500
    rounds: Annotated[int, Range(0, 1_000_000)] = 12
    patience: Annotated[int, Range(1, 1_000_000)] = 3

    def __post_init__(self) -> None:
        """Refuse what can't be."""
        check_ranges(self)


def regress_conditional(
    network: ConditionalMonotoneMap,
    training: Sequence[NDArray[np.float32]],
    validation: Sequence[NDArray[np.float32]],
    steps: RegressionSteps,
    *,
    checkpoint: Path | None = None,
    progress: bool = True,
) -> float:
    """Fit a conditional map to the quantiles of values in bins of their condition, 182 of them for a large sample.

    The bins are even in the logit of the condition's level, so that the sparse ends are resolved too. Below 400,000
    muons they are wider, by the root of their number: narrow ones would have no tails to learn from. Adam is followed
    by L-BFGS (D. C. Liu and J. Nocedal, Math. Program. 45 (1989) 503), in double precision. The network is left with
    the weights that have the smallest pinball loss of the validation muons, of fifteen looks while Adam runs and one
    after each round of L-BFGS; the last ones where it hardly differs.

    Parameters
    ----------
    network
        Trained in place.
    training, validation
        Condition [n] and values [n].
    steps
        How long.
    checkpoint
        File that holds the whole state after each round; where it exists, the fit goes on from it and ends with the
        same weights as an undisturbed one on the same machine.
    progress
        Whether to show rounds, validation loss and time left on stderr.

    Returns
    -------
    float
        The pinball loss that these weights have.

    Raises
    ------
    RefusedError
        If the checkpoint is of other data, steps or number of threads.
    FailedError
        If the loss was never a finite number.
    """
    points, quantiles, weights = (torch.from_numpy(part) for part in _binned_quantiles(*training))
    points = points.unsqueeze(-1)
    levels = torch.from_numpy(_LEVELS).expand(len(points), -1)
    network.double()

    def loss() -> torch.Tensor:
        difference: torch.Tensor = network(levels, points) - quantiles
        return (weights * difference**2).mean()

    lbfgs = torch.optim.LBFGS(
        network.parameters(),
        max_iter=steps.round,
        history_size=50,
        tolerance_grad=0,
        tolerance_change=0,
        line_search_fn="strong_wolfe",
    )
    initial = [parameter.detach().numpy() for parameter in network.parameters()]
    kept = Checkpoint(checkpoint, data=fingerprint(*initial, *training, *validation), steps=asdict(steps))
    state = kept.load()
    if state is None:
        state = {"round": 0, "misses": 0, "best": np.inf, "kept": np.inf, "weights": None}
        for _ in _run_adam(network, loss, steps.adam, progress):
            _judge(state, _validation_loss(network, *validation), network)
        state["misses"] = 0
    else:
        network.load_state_dict(state.pop("network"))
        lbfgs.load_state_dict(state.pop("lbfgs"))
    with progress_bar(steps.rounds, "zenith, L-BFGS", " rounds", hidden=not progress, initial=state["round"]) as bar:
        while state["round"] < steps.rounds and state["misses"] < steps.patience:
            lbfgs.step(lambda: _backward(lbfgs, loss))  # type: ignore[no-untyped-call]
            found = _validation_loss(network, *validation)
            _judge(state, found, network)
            state["round"] += 1
            kept.save(network=network.state_dict(), lbfgs=lbfgs.state_dict(), **state)
            bar.set_postfix(pinball=f"{found:.7g}", best=f"{state['best']:.7g}", refresh=False)
            bar.update()
    if state["weights"] is None:
        raise FailedError("the validation loss of the zenith map is no finite number: training diverged")
    network.load_state_dict(state["weights"])
    network.float()
    return float(state["kept"])


def _run_adam(
    network: ConditionalMonotoneMap, loss: Callable[[], torch.Tensor], steps: int, progress: bool
) -> Iterator[None]:
    """Run Adam, and pause for a look at the network every now and then, at least at the end."""
    adam = torch.optim.Adam(network.parameters(), lr=0.01)
    fall = torch.optim.lr_scheduler.CosineAnnealingLR(adam, steps)
    with progress_bar(steps, "zenith, Adam", " steps", hidden=not progress) as bar:
        for step in range(steps):
            _backward(adam, loss)
            adam.step()
            fall.step()
            bar.update()
            if (step + 1) * _LOOKS // steps > step * _LOOKS // steps:
                yield
    if steps == 0:
        yield


def _judge(state: dict[str, Any], found: float, network: ConditionalMonotoneMap) -> None:
    """Keep the weights unless their loss is above the best one, or no number."""
    if np.isfinite(found) and found <= state["best"] * (1 + _NEGLIGIBLE):
        state.update(kept=found, weights=copy.deepcopy(network.state_dict()), misses=0)
    else:
        state["misses"] += 1
    state["best"] = min(state["best"], found)


def _validation_loss(
    network: ConditionalMonotoneMap, condition: NDArray[np.float32], values: NDArray[np.float32]
) -> float:
    """Return the pinball loss: each muon's at a few levels, which together cover (0, 1) evenly."""
    level = (np.arange(len(values))[:, None] * _GOLDEN + np.arange(_LEVELS_OF_MUON) / _LEVELS_OF_MUON) % 1
    level = torch.from_numpy(np.clip(level, 1e-6, 1 - 1e-6))
    with torch.no_grad():
        predicted = network(torch.logit(level), torch.from_numpy(condition).double().unsqueeze(-1))
    return float(pinball_loss(predicted, torch.from_numpy(values).double().unsqueeze(-1), level).mean())


def _backward(optimizer: torch.optim.Optimizer, loss: Callable[[], torch.Tensor]) -> float:
    optimizer.zero_grad()
    value = loss()
    value.backward()  # type: ignore[no-untyped-call]
    return float(value.detach())


def _binned_quantiles(condition: NDArray[np.float32], values: NDArray[np.float32]) -> tuple[Float, Float, Float]:
    """Return the bins' mean condition [bins], and quantiles and weights at the levels [bins, levels]."""
    order = np.argsort(condition)
    condition, values = condition[order].astype(np.float64), values[order].astype(np.float64)
    width = max(_NARROWEST, _WIDTH_BY_ROOT / np.sqrt(len(values)))
    levels = expit(np.arange(-_REACH, _REACH + width / 2, width))
    edges = np.round(len(values) * np.concatenate([[0], levels, [1]])).astype(int)
    rows = [slice(a, b) for a, b in pairwise(edges) if b - a >= _FEWEST_IN_BIN]
    level = expit(_LEVELS)
    # Hazen's plotting positions are nearly unbiased in the logarithm of a tail's level.
    quantiles = np.array([np.quantile(values[row], level, method="hazen") for row in rows])
    number = np.array([[row.stop - row.start] for row in rows])
    slope = np.maximum(np.gradient(quantiles, _LEVELS, axis=1), _FLATTEST)
    weights = number * level * (1 - level) / slope**2
    weights[number * np.minimum(level, 1 - level) < _FEWEST_BEYOND] = 0
    return np.array([condition[row].mean() for row in rows]), quantiles, weights / weights.mean()
