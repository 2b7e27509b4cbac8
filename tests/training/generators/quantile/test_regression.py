from __future__ import annotations

import copy
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.special import expit, logit
from scipy.stats import kstest, norm
from support.terminal import terminal

from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_training.generators.quantile import regression as quantile_regression
from deepmuon_training.generators.quantile.regression import RegressionSteps, regress, regress_conditional
from deepmuon_training.learning.monotone import ConditionalMonotoneMap, MonotoneMap

N = 100_000
STEPS = RegressionSteps(adam=300, round=30, rounds=2)


def mapped(network, *arguments) -> np.ndarray:
    with torch.no_grad():
        return copy.deepcopy(network).double()(*(torch.as_tensor(a, dtype=torch.float64) for a in arguments)).numpy()


def test_the_map_takes_the_logit_of_the_level_to_the_quantile():
    values = np.random.default_rng(1).gumbel(size=N)  # with quantiles -log(-log(level))
    network = MonotoneMap(97, 12.0)
    regress(network, values, tail=0.001)
    level = np.linspace(0.001, 0.999, 1001)
    found = mapped(network, logit(level))
    moved = np.abs(np.exp(-np.exp(-found)) - level)
    assert moved.max() < 1.95 / np.sqrt(N)  # the sample's own KS distance: more than that once in 1000


def conditional_logistic(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A logistic distribution whose centre and width depend on the condition, uniform in (-1, 1)."""
    random = np.random.default_rng(seed)
    condition = 2 * random.random(n) - 1
    values = centre(condition) + width(condition) * random.logistic(size=n)
    return condition.astype(np.float32), values.astype(np.float32)


def centre(condition):
    return np.sin(3 * condition)


def width(condition):
    return 1 + 0.5 * condition


def trained(steps, seed=1, **options) -> tuple[ConditionalMonotoneMap, float]:
    torch.manual_seed(1)
    network = ConditionalMonotoneMap(units=33, reach=12.0, conditions=1, hidden=32)
    training, validation = conditional_logistic(N, seed), conditional_logistic(N // 10, 2)
    loss = regress_conditional(network, training, validation, steps, **{"progress": False, **options})
    return network, loss


def weights(network) -> torch.Tensor:
    return torch.cat([parameter.detach().flatten() for parameter in network.parameters()])


@pytest.fixture(scope="module")
def conditional_and_loss() -> tuple[ConditionalMonotoneMap, float]:
    return trained(STEPS)


@pytest.fixture
def conditional(conditional_and_loss) -> ConditionalMonotoneMap:
    return conditional_and_loss[0]


def test_the_conditional_map_makes_the_distribution_at_each_condition(conditional):
    assert all(parameter.dtype == torch.float32 for parameter in conditional.parameters())
    for condition in (-0.9, -0.3, 0.3, 0.9):
        level = (np.arange(2000) + 0.5) / 2000
        values = mapped(conditional, logit(level)[None], [[condition]])[0]
        standard = (values - centre(condition)) / width(condition)
        assert kstest(standard, expit).statistic < 0.02  # a bin has 1,100 muons: noise 0.026


SHORT = RegressionSteps(adam=10, round=2, rounds=4)


def test_the_regression_has_no_randomness_of_its_own():
    assert torch.equal(*(weights(trained(SHORT)[0]) for _ in range(2)))


@pytest.mark.parametrize("rounds", [0, 1, 3])
def test_a_regression_that_was_killed_goes_on_to_the_same_weights_bit_by_bit(tmp_path, monkeypatch, rounds):
    judge, calls = quantile_regression._judge, iter(range(10 + rounds))  # ten looks while Adam runs

    def dying(*arguments):
        if next(calls, None) is None:
            raise KeyboardInterrupt
        judge(*arguments)

    checkpoint = tmp_path / "zenith.pt"
    with monkeypatch.context() as patch:
        patch.setattr(quantile_regression, "_judge", dying)
        with pytest.raises(KeyboardInterrupt):
            trained(SHORT, checkpoint=checkpoint)
    assert checkpoint.exists() == (rounds > 0)
    resumed, loss = trained(SHORT, checkpoint=checkpoint)
    undisturbed, expected = trained(SHORT)
    assert torch.equal(weights(resumed), weights(undisturbed))
    assert loss == expected


def test_the_checkpoint_of_another_regression_is_refused(tmp_path):
    trained(SHORT, checkpoint=tmp_path / "zenith.pt")
    with pytest.raises(RefusedError, match="is a checkpoint of the steps"):
        trained(replace(SHORT, rounds=5), checkpoint=tmp_path / "zenith.pt")
    with pytest.raises(RefusedError, match="is a checkpoint of other data"):
        trained(SHORT, seed=3, checkpoint=tmp_path / "zenith.pt")


def test_progress_changes_nothing(monkeypatch):
    written = terminal(monkeypatch)
    shown, quiet = (trained(SHORT, progress=progress) for progress in (True, False))
    assert torch.equal(weights(shown[0]), weights(quiet[0]))
    assert shown[1] == quiet[1]
    assert "4/4" in written.getvalue()


def losses(monkeypatch, values: list[float]) -> list[torch.Tensor]:
    """Plan the validation losses: 10 looks while Adam runs, one after each round; return the weights at each look."""
    looks: list[torch.Tensor] = []

    def planned(network, condition, observed):
        looks.append(weights(network).float())
        return values[len(looks) - 1]

    monkeypatch.setattr(quantile_regression, "_validation_loss", planned)
    return looks


ADAM = [9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.5, 2.0, 1.5]


def test_it_stops_when_patience_ends_and_keeps_the_best_weights(monkeypatch):
    looks = losses(monkeypatch, [*ADAM, 1.0, 2.0, 2.0, 0.5])
    network, loss = trained(replace(SHORT, patience=2))
    assert len(looks) == 13  # three rounds after Adam
    assert loss == 1.0
    assert torch.equal(weights(network), looks[10])


def test_weights_in_the_middle_of_adam_are_kept_where_they_are_the_best(monkeypatch):
    looks = losses(monkeypatch, [*ADAM[:3], 0.5, *ADAM[4:], 1.0, 1.0, 1.0])
    network, loss = trained(replace(SHORT, patience=3))
    assert len(looks) == 13  # what Adam's looks missed does not count
    assert loss == 0.5
    assert torch.equal(weights(network), looks[3])


def test_later_weights_that_are_hardly_worse_are_kept(monkeypatch):
    looks = losses(monkeypatch, [*ADAM, 1.0, 1.00001, 1.00001, 1.00003])
    network, loss = trained(SHORT)
    assert len(looks) == 14
    assert loss == 1.00001
    assert torch.equal(weights(network), looks[12])


def test_weights_whose_loss_is_no_number_are_not_kept(monkeypatch):
    looks = losses(monkeypatch, [*ADAM, 1.0, math.nan, math.inf, math.nan])
    network, loss = trained(SHORT)
    assert loss == 1.0
    assert torch.equal(weights(network), looks[10])


def test_a_regression_that_diverged_from_the_start_is_told(monkeypatch):
    losses(monkeypatch, [math.nan] * 14)
    with pytest.raises(FailedError, match="no finite number"):
        trained(SHORT)


def test_it_stops_after_the_last_round_at_the_latest(monkeypatch):
    looks = losses(monkeypatch, [*ADAM, 1.4, 1.3, 1.2, 1.1, 0.0])
    network, loss = trained(SHORT)
    assert len(looks) == 14
    assert loss == 1.1
    assert torch.equal(weights(network), looks[13])


def test_of_many_steps_of_adam_fifteen_are_looked_at(monkeypatch):
    looks = losses(monkeypatch, [1.0] * 16)
    trained(RegressionSteps(adam=31, round=1, rounds=1))
    assert len(looks) == 16


def test_the_validation_loss_is_the_pinball_loss_over_all_levels(conditional_and_loss):
    # That is half the continuous ranked probability score, E|X - Y| - E|X - X'| / 2 = width of a logistic distribution.
    mean_width = 1.0
    assert conditional_and_loss[1] == pytest.approx(mean_width / 2, rel=0.03)  # 10,000 muons: noise 0.01


def test_weights_that_fit_the_training_muons_but_not_the_validation_muons_are_not_kept():
    torch.manual_seed(1)
    network = ConditionalMonotoneMap(units=9, reach=12.0, conditions=1, hidden=8)
    before = copy.deepcopy(network.state_dict())
    condition, values = conditional_logistic(20_000, 4)
    predicted = mapped(network, np.zeros((1, 1)), [[0.0]])
    constant = condition, np.full_like(values, predicted.item())  # nothing could be nearer than the first weights are
    far = condition, values + np.float32(100)
    steps = RegressionSteps(adam=0, round=5, rounds=9, patience=2)
    assert regress_conditional(network, far, constant, steps, progress=False) < 1
    for name, value in network.state_dict().items():
        torch.testing.assert_close(value, before[name])


def test_a_heavy_end_of_the_condition_does_not_break_the_bins():
    condition, values = conditional_logistic(20_000, 2)
    condition = np.clip(condition, -0.5, 0.5)  # half of the sample shares two conditions
    network = ConditionalMonotoneMap(units=9, reach=12.0, conditions=1, hidden=8)
    sample = condition, values
    regress_conditional(network, sample, sample, RegressionSteps(adam=20, round=5, rounds=1), progress=False)
    assert np.all(np.isfinite(mapped(network, np.zeros((3, 1)), [[-0.5], [0.0], [0.5]])))


@pytest.mark.parametrize("seed", [1, 3])
def test_a_few_thousand_muons_give_tails_that_are_theirs(seed):
    # Bins of a hundred muons say nothing of the outer five per cent. The logistic tails that went on from there, and
    # maps kept after they had learned the noise, had once half or twice as many muons beyond the 1 % levels.
    random = np.random.default_rng(seed)
    condition = 2 * random.random(6000) - 1
    values = centre(condition) + random.normal(size=6000)
    parts = [np.float32([condition[rows], values[rows]]) for rows in (slice(300, None), slice(300))]
    torch.manual_seed(1)
    network = ConditionalMonotoneMap(units=33, reach=12.0, conditions=1, hidden=32)
    regress_conditional(network, *parts, RegressionSteps(round=50, rounds=3), progress=False)
    condition, level = 2 * random.random(40_000) - 1, random.random(40_000)
    normal = mapped(network, logit(level)[:, None], condition[:, None])[:, 0] - centre(condition)
    beyond = [np.mean(normal < norm.ppf(0.01)), np.mean(normal > norm.ppf(0.99))]
    assert beyond == pytest.approx([0.01, 0.01], rel=0.35)  # 57 muons of the sample: 13 %, once in 70 seeds beyond


def test_the_slope_has_no_ripples_where_the_truth_is_a_straight_line(conditional_and_loss):
    # A logistic distribution's quantile function is one. Units that had died in training left ripples of 8 % once.
    level = np.linspace(-3, 3, 61)
    for condition in (-0.6, 0.0, 0.6):
        slope = np.diff(mapped(conditional_and_loss[0], level[None], [[condition]])[0]) / np.diff(level)
        assert np.std(slope) / np.mean(slope) < 0.03
