from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from support.terminal import terminal
from torch import nn

from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_training.learning.checkpoint import fingerprint
from deepmuon_training.learning.descent import Schedule, fit
from deepmuon_training.sealed import read_sealed

SCHEDULE = Schedule(steps=60, learning_rate=0.05, weight_decay=0.01, averaging=0.9, validate_every=10)


class KilledError(Exception):
    pass


def network(hidden: int = 4) -> nn.Module:
    torch.manual_seed(0)
    return nn.Sequential(nn.Linear(2, hidden), nn.Tanh(), nn.Linear(hidden, 1))


def loss(net: nn.Module, random: torch.Generator) -> torch.Tensor:
    x = torch.rand(32, 2, generator=random)
    return (net(x)[:, 0] - x.prod(dim=1)).square().mean()


@torch.no_grad()
def distance(net: nn.Module) -> float:
    x = torch.rand(100, 2, generator=torch.Generator().manual_seed(1))
    return float((net(x)[:, 0] - x.prod(dim=1)).square().mean())


def killed_after(steps: int) -> Callable[[nn.Module, torch.Generator], torch.Tensor]:
    calls = iter(range(steps))

    def dying(net: nn.Module, random: torch.Generator) -> torch.Tensor:
        if next(calls, None) is None:
            raise KilledError
        return loss(net, random)

    return dying


def fitted(net: nn.Module, schedule: Schedule = SCHEDULE, *, seed: int = 1, **options: object) -> list[torch.Tensor]:
    arguments = {"loss": loss, "distance": distance, **options}
    fit(net, schedule=schedule, seed=seed, name="test", progress=False, **arguments)
    return [parameter.detach().clone() for parameter in net.parameters()]


def same(a: list[torch.Tensor], b: list[torch.Tensor]) -> bool:
    return all(torch.equal(x, y) for x, y in zip(a, b, strict=True))


def test_the_fit_lessens_the_validation_distance():
    net = network()
    before = distance(net)
    best = fit(net, loss, distance, SCHEDULE, seed=1, name="test", progress=False)
    assert best == distance(net) < 0.5 * before


def test_a_seed_gives_the_same_weights_again_and_another_others():
    assert same(fitted(network()), fitted(network()))
    assert not same(fitted(network()), fitted(network(), seed=2))


@pytest.mark.parametrize("steps", [3, 10, 25, 59])
def test_a_fit_that_was_killed_goes_on_to_the_same_weights_bit_by_bit(tmp_path: Path, steps: int):
    checkpoint = tmp_path / "fit.pt"
    with pytest.raises(KilledError):
        fitted(network(), loss=killed_after(steps), checkpoint=checkpoint)
    assert checkpoint.exists() == (steps >= SCHEDULE.validate_every)
    assert same(fitted(network(), checkpoint=checkpoint), fitted(network()))


def test_a_fit_can_be_killed_again_and_again(tmp_path: Path):
    checkpoint = tmp_path / "fit.pt"
    for _ in range(4):
        with pytest.raises(KilledError):
            fitted(network(), loss=killed_after(13), checkpoint=checkpoint)
    assert same(fitted(network(), checkpoint=checkpoint), fitted(network()))


def test_a_finished_fit_is_not_repeated(tmp_path: Path):
    checkpoint = tmp_path / "fit.pt"
    weights = fitted(network(), checkpoint=checkpoint)
    assert same(fitted(network(), loss=killed_after(0), checkpoint=checkpoint), weights)


def test_stopping_early_is_remembered(tmp_path: Path):
    checkpoint, impatient = tmp_path / "fit.pt", replace(SCHEDULE, patience=1)
    weights = fitted(network(), impatient, distance=lambda net: 1.0, checkpoint=checkpoint)
    assert same(fitted(network(), impatient, loss=killed_after(0), checkpoint=checkpoint), weights)


@pytest.mark.parametrize("other", [{"steps": 61}, {"learning_rate": 0.04}, {"averaging": 0.8}, {"validate_every": 20}])
def test_the_checkpoint_of_another_schedule_is_refused(tmp_path: Path, other: dict[str, float]):
    checkpoint = tmp_path / "fit.pt"
    fitted(network(), checkpoint=checkpoint)
    with pytest.raises(RefusedError, match="is a checkpoint of the schedule"):
        fitted(network(), replace(SCHEDULE, **other), checkpoint=checkpoint)


def test_the_checkpoint_of_another_seed_is_refused(tmp_path: Path):
    checkpoint = tmp_path / "fit.pt"
    fitted(network(), checkpoint=checkpoint)
    with pytest.raises(RefusedError, match="is a checkpoint of the seed 1, not of 2"):
        fitted(network(), seed=2, checkpoint=checkpoint)


def test_the_checkpoint_of_another_network_is_refused(tmp_path: Path):
    checkpoint = tmp_path / "fit.pt"
    fitted(network(), checkpoint=checkpoint)
    with pytest.raises(RefusedError, match="is a checkpoint of the number of weights 17, not of 21"):
        fitted(network(hidden=5), checkpoint=checkpoint)


def test_the_checkpoint_of_other_data_is_refused(tmp_path: Path):
    checkpoint = tmp_path / "fit.pt"
    x = np.arange(6, dtype=np.float32)
    fitted(network(), checkpoint=checkpoint, data=fingerprint(x))
    fitted(network(), checkpoint=checkpoint, data=fingerprint(x.copy()))
    for other in (x + 1, x[:5], x.reshape(2, 3), x.astype(np.float64)):
        with pytest.raises(RefusedError, match="is a checkpoint of other data: remove it"):
            fitted(network(), checkpoint=checkpoint, data=fingerprint(other))


def test_the_checkpoint_of_another_number_of_threads_is_refused(tmp_path: Path):
    checkpoint = tmp_path / "fit.pt"
    fitted(network(), checkpoint=checkpoint)
    torch.set_num_threads(2)
    try:
        with pytest.raises(RefusedError, match="is a checkpoint of the number of threads 1, not of 2"):
            fitted(network(), checkpoint=checkpoint)
    finally:
        torch.set_num_threads(1)


@settings(max_examples=30)
@given(st.data())
def test_a_checkpoint_of_which_any_byte_was_changed_is_refused(tmp_path_factory, data: st.DataObject):
    checkpoint = tmp_path_factory.mktemp("flipped") / "fit.pt"
    fitted(network(), replace(SCHEDULE, steps=2), checkpoint=checkpoint)
    content = bytearray(checkpoint.read_bytes())
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    checkpoint.write_bytes(content)
    with pytest.raises(RefusedError, match=r"(is damaged|is no checkpoint of this version).*: remove it") as refusal:
        fitted(network(), replace(SCHEDULE, steps=2), checkpoint=checkpoint)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("content", [b"", b"no checkpoint", b"PK"])
def test_a_damaged_checkpoint_is_refused(tmp_path: Path, content: bytes):
    checkpoint = tmp_path / "fit.pt"
    checkpoint.write_bytes(content)
    with pytest.raises(RefusedError, match="is no checkpoint of this version: remove it"):
        fitted(network(), checkpoint=checkpoint)


def test_a_slow_fit_is_also_saved_between_two_looks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(time, "monotonic", count(0, 20).__next__)  # each call is 20 seconds later
    checkpoint = tmp_path / "fit.pt"
    with pytest.raises(KilledError):
        fitted(network(), loss=killed_after(7), checkpoint=checkpoint)
    assert 0 < read_sealed(checkpoint, "checkpoint", "").pop("numbers")[0] <= 7
    assert same(fitted(network(), checkpoint=checkpoint), fitted(network()))


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"steps": 0}, "steps is 0, and should be from 1 to 100,000,000"),
        ({"steps": -5}, "steps is -5"),
        ({"learning_rate": -0.1}, "learning_rate is -0.1, and should be above 0 and at most 1"),
        ({"learning_rate": float("nan")}, "learning_rate is nan"),
        ({"averaging": 1.0}, "averaging is 1.0, and should be at least 0 and below 1"),
        ({"weight_decay": -1e-9}, "weight_decay is -1e-09"),
        ({"validate_every": 0}, "validate_every is 0"),
        ({"patience": 0}, "patience is 0"),
    ],
)
def test_a_schedule_that_cannot_be_is_refused(values: dict[str, float], complaint: str):
    with pytest.raises(RefusedError) as refusal:
        replace(SCHEDULE, **values)
    assert complaint in str(refusal.value)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_loss_that_diverges_is_an_error(value: float):
    with pytest.raises(FailedError, match=r"the loss is (nan|inf) after 0 steps"):
        fitted(network(), loss=lambda net, random: loss(net, random) * value)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_distance_that_diverges_is_an_error(value: float):
    with pytest.raises(FailedError, match=r"the validation distance is (nan|inf) after 10 steps"):
        fitted(network(), distance=lambda net: value)


class Recorder:
    """Remembers the weights at each step and the averaged ones at each look."""

    def __init__(self, distances: list[float] | None = None) -> None:
        self.distances = iter(distances or ())
        self.weights: list[torch.Tensor] = []
        self.averaged: list[torch.Tensor] = []

    def loss(self, net: nn.Module, random: torch.Generator) -> torch.Tensor:
        self.weights.append(net[0].weight.detach().clone())
        return loss(net, random)

    def distance(self, net: nn.Module) -> float:
        self.averaged.append(net[0].weight.detach().clone())
        return next(self.distances, 1.0)


def test_the_fit_stops_when_patience_ends_and_keeps_the_best_weights():
    recorder, net = Recorder([3.0, 1.0, 2.0, 1.0, 0.5]), network()
    schedule = replace(SCHEDULE, patience=2)
    best = fit(net, recorder.loss, recorder.distance, schedule, seed=1, name="test", progress=False)
    assert best == 1.0
    assert len(recorder.weights) == 40  # the third and fourth look were no better than the second
    assert torch.equal(net[0].weight, recorder.averaged[1])


def test_the_last_step_is_looked_at():
    recorder = Recorder()
    fitted(network(), replace(SCHEDULE, steps=25), loss=recorder.loss, distance=recorder.distance)
    assert len(recorder.averaged) == 3


def test_the_validated_weights_are_an_exponential_moving_average_that_has_no_part_of_its_start():
    recorder = Recorder()
    fitted(network(), replace(SCHEDULE, validate_every=1), loss=recorder.loss, distance=recorder.distance)
    total, share = torch.zeros_like(recorder.weights[1]), 0.0
    for weight, found in zip(recorder.weights[1:], recorder.averaged, strict=False):
        total, share = 0.9 * total + 0.1 * weight, 0.9 * share + 0.1
        torch.testing.assert_close(found, total / share)


def test_the_learning_rate_rises_over_a_hundredth_of_the_steps_and_falls_along_a_half_cosine():
    schedule = Schedule(steps=1000, learning_rate=1.0)
    assert [schedule.rate_at(step) for step in range(3)] == pytest.approx([0.1, 0.2, 0.3], rel=1e-4)
    assert schedule.rate_at(9) == pytest.approx(1, abs=1e-3)
    assert schedule.rate_at(500) == pytest.approx(0.5, abs=1e-6)
    assert schedule.rate_at(999) == pytest.approx(0, abs=1e-5)


def test_progress_shows_steps_loss_distance_and_time_left(monkeypatch: pytest.MonkeyPatch):
    shown = terminal(monkeypatch)
    fit(network(), loss, distance, SCHEDULE, seed=1, name="energy", progress=True)
    for part in ("energy:", "60/60", "loss=", "distance=", "<00:00"):
        assert part in shown.getvalue()


def test_a_quiet_fit_says_nothing(capfd: pytest.CaptureFixture[str]):
    fitted(network())
    assert capfd.readouterr() == ("", "")
