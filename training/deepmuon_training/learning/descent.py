"""The training loop that all networks share."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import torch
from torch import nn
from torch.optim.swa_utils import AveragedModel

from deepmuon_runtime.errors import FailedError
from deepmuon_training.learning.checkpoint import Checkpoint
from deepmuon_training.progress import progress_bar
from deepmuon_training.ranges import Range, check_ranges

__all__ = ["Schedule", "fit"]

_Tensors = Sequence[torch.Tensor]


@dataclass(frozen=True)
class Schedule:
    """How long and how fast to train.

    Parameters
    ----------
    steps
        Steps at most; the learning rate falls along a half cosine over this many.
    learning_rate
        Of AdamW, at its highest, after a linear rise over the first hundredth of the steps.
    weight_decay
        Of AdamW; 0 is Adam.
    averaging
        Decay of the exponential moving average of the weights, corrected for its start as Adam's are; the averaged
        weights are the result.
    validate_every
        Steps between two looks at the validation distance.
    patience
        Stop after so many looks without a better one.

    Raises
    ------
    RefusedError
        If a value is out of its range.
    """

    steps: Annotated[int, Range(1, 100_000_000)]
    learning_rate: Annotated[float, Range(0, 1, above=True)]
    weight_decay: Annotated[float, Range(0, 1)] = 0.0
    averaging: Annotated[float, Range(0, 1, below=True)] = 0.999
    validate_every: Annotated[int, Range(1, 100_000_000)] = 500
    patience: Annotated[int, Range(1, 1_000_000)] = 20

    def __post_init__(self) -> None:
        """Refuse what can't be."""
        check_ranges(self)

    def rate_at(self, step: int) -> float:
        """Learning rate at a step, relative to the highest."""
        rise = min(1.0, (step + 1) / max(1, self.steps // 100))
        return rise * 0.5 * (1 + float(torch.cos(torch.tensor(torch.pi * step / self.steps))))


def fit(
    network: nn.Module,
    loss: Callable[[nn.Module, torch.Generator], torch.Tensor],
    distance: Callable[[nn.Module], float],
    schedule: Schedule,
    *,
    seed: int,
    name: str,
    data: str = "",
    checkpoint: Path | None = None,
    progress: bool = True,
) -> float:
    """Train a network in place and leave in it the averaged weights with the smallest validation distance.

    Parameters
    ----------
    network
        Trained where it lies, on the CPU or a GPU.
    loss
        Draws a batch with the generator (always on the CPU) and returns the loss to make small.
    distance
        The validation distance of a network: of data that the loss never draws from.
    schedule
        Steps, rates, averaging and stopping.
    seed
        Seeds the generator of the batches. The initial weights are the caller's.
    name
        Shown by the progress bar.
    data
        Fingerprint of what the loss and the distance are made of, by which a checkpoint knows its own.
    checkpoint
        File that holds the whole state at each look at the distance, and every half minute; where it exists, the fit
        goes on from it and ends with the same weights as an undisturbed one on the same machine.
    progress
        Whether to show steps, loss, distance and the time left on stderr.

    Returns
    -------
    float
        The smallest distance.

    Raises
    ------
    RefusedError
        If the checkpoint is of other data, schedule, seed, network or number of threads.
    FailedError
        If the loss or the distance is no finite number.
    """
    state = _State(network, schedule, seed)
    weights = sum(parameter.numel() for parameter in network.parameters())
    kept = Checkpoint(checkpoint, data=data, seed=seed, schedule=asdict(schedule), **{"number of weights": weights})
    state.load(kept)
    bar = progress_bar(schedule.steps, name, " steps", hidden=not progress, initial=state.step)
    with bar:
        while state.step < schedule.steps and state.misses < schedule.patience:
            value = state.advance(loss)
            bar.update()
            if state.step % schedule.validate_every == 0 or state.step == schedule.steps:
                state.look(distance)
                bar.set_postfix(
                    loss=f"{value:.4g}", distance=f"{state.last:.4g}", best=f"{state.best:.4g}", refresh=False
                )
                state.save(kept)
            elif kept.is_due:
                state.save(kept)
    network.load_state_dict(state.best_weights)
    return state.best


def _moving_average(
    decay: float,
) -> Callable[[Sequence[torch.Tensor], Sequence[torch.Tensor], torch.Tensor | int], None]:
    """Return the update of an exponential moving average that has forgotten what it began with.

    A plain one gives the first weights the share decay^t of all t steps: most of it, while t is below 1 / (1 - decay).
    Dividing by 1 - decay^t (D. P. Kingma and J. Ba, arXiv:1412.6980, section 3) takes that out.
    """

    @torch.no_grad()
    def update(average: _Tensors, weights: _Tensors, averaged: torch.Tensor | int) -> None:
        share = (1 - decay) / (1 - decay ** (int(averaged) + 1))
        for mean, weight in zip(average, weights, strict=True):
            mean.lerp_(weight, share)

    return update


class _State:
    """Everything that a resumed fit must know."""

    def __init__(self, network: nn.Module, schedule: Schedule, seed: int) -> None:
        self.network, self.schedule = network, schedule
        self.average = AveragedModel(network, multi_avg_fn=_moving_average(schedule.averaging))
        self.optimizer = torch.optim.AdamW(
            network.parameters(), lr=schedule.learning_rate, weight_decay=schedule.weight_decay
        )
        self.random = torch.Generator().manual_seed(seed)
        self.step, self.misses, self.best, self.last = 0, 0, float("inf"), float("inf")
        self.best_weights = copy.deepcopy(network.state_dict())

    def advance(self, loss: Callable[[nn.Module, torch.Generator], torch.Tensor]) -> float:
        for group in self.optimizer.param_groups:
            group["lr"] = self.schedule.learning_rate * self.schedule.rate_at(self.step)
        self.optimizer.zero_grad(set_to_none=True)
        value = loss(self.network, self.random)
        number = float(value.detach())
        self._check("loss", number)
        value.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step()
        self.average.update_parameters(self.network)
        self.step += 1
        return number

    def look(self, distance: Callable[[nn.Module], float]) -> None:
        with torch.no_grad():
            self.last = distance(self.average.module)
        self._check("validation distance", self.last)
        self.misses += 1
        if self.last < self.best:
            self.best, self.misses = self.last, 0
            self.best_weights = copy.deepcopy(self.average.module.state_dict())

    def _check(self, name: str, value: float) -> None:
        if not math.isfinite(value):
            raise FailedError(f"the {name} is {value} after {self.step} steps: training diverged, try a lower rate")

    def save(self, kept: Checkpoint) -> None:
        kept.save(
            network=self.network.state_dict(),
            average=self.average.state_dict(),
            optimizer=self.optimizer.state_dict(),
            random=self.random.get_state(),
            best_weights=self.best_weights,
            numbers=(self.step, self.misses, self.best, self.last),
        )

    def load(self, kept: Checkpoint) -> None:
        parts = kept.load()
        if parts is None:
            return
        self.network.load_state_dict(parts["network"])
        self.random.set_state(parts["random"])
        self.average.load_state_dict(parts["average"])
        self.optimizer.load_state_dict(parts["optimizer"])
        self.best_weights = parts["best_weights"]
        self.step, self.misses, self.best, self.last = parts["numbers"]
