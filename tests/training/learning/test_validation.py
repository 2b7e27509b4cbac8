from __future__ import annotations

import numpy as np
import pytest

from deepmuon_training.learning.validation import split, training_rows


@pytest.mark.parametrize("n", [20, 999, 100_000])
def test_the_last_twentieth_validates_and_no_row_is_lost(n):
    a, b = np.arange(n), np.arange(n) * 0.5
    training, validation = split(a, b)
    assert len(validation[0]) == pytest.approx(n / 20, abs=1)
    np.testing.assert_array_equal(np.concatenate([training[0], validation[0]]), a)
    np.testing.assert_array_equal(np.concatenate([training[1], validation[1]]), b)


def test_the_parts_lie_together_in_memory():
    columns = np.arange(300.0).reshape(100, 3)
    for part in split(*columns.T):
        assert all(column.flags.c_contiguous for column in part)


def test_of_a_large_sample_half_a_million_muons_validate():
    assert training_rows(10_000_000) == 9_500_000
    assert training_rows(100_000_000) == 99_500_000
