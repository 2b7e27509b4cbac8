from __future__ import annotations

import numpy as np
import torch

from deepmuon_training.learning.condition import EnergyCondition


def test_all_but_the_outermost_muons_have_conditions_of_their_own_between_minus_1_and_1():
    y = np.random.default_rng(1).permutation(np.arange(10_000, dtype=np.float32))
    condition = EnergyCondition.fit(y)(torch.from_numpy(y)).numpy()[np.argsort(y)]
    np.testing.assert_array_equal(condition[:201], -1)
    np.testing.assert_array_equal(condition[-200:], 1)
    assert np.all(np.diff(condition[200:-199]) > 0)


def test_the_condition_is_linear_between_its_ends_and_constant_beyond():
    condition = EnergyCondition(low=-2.0, high=6.0)
    y = torch.tensor([-100.0, -2.0, 0.0, 2.0, 6.0, 100.0])
    torch.testing.assert_close(condition(y), torch.tensor([-1.0, -1.0, -0.5, 0.0, 1.0, 1.0]))
