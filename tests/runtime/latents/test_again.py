from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from deepmuon_runtime.latents.again import numbers_again

LARGEST = 2**64 - 1


def by_numpy(seed: int, stream: int, attempt: int, draw: int, size: int) -> np.ndarray:
    """The numbers of one draw, in the words of its documentation."""
    counters = -(-size // 8)
    counter = draw * counters + (attempt << 128) + (4 << 192)  # numpy counts up first
    words = np.random.Philox(key=seed + (stream << 64), counter=counter).random_raw(4 * counters)
    halves = words.astype("<u8").view("<i4")[:size]
    return ((halves >> 8) + 0.5) * 2.0**-23


@settings(deadline=None)
@given(
    seed=st.integers(0, LARGEST),
    stream=st.integers(0, LARGEST),
    draws=st.lists(st.integers(0, 10**6), min_size=1, max_size=50),
    size=st.integers(1, 130),
    attempts=st.lists(st.integers(1, 2**40), min_size=1, max_size=3),
)
def test_draws_that_are_made_again_have_numpys_numbers(seed, stream, draws, size, attempts):
    each = sorted((draw, attempt) for draw in draws for attempt in attempts)
    draw, attempt = np.array(each).T
    expected = [by_numpy(seed, stream, attempt, draw, size) for draw, attempt in each]
    assert np.array_equal(numbers_again(seed, stream, attempt, draw, size), expected)


def test_many_neighbours_have_the_same_numbers_as_each_alone():
    draws = np.flatnonzero(np.random.default_rng(1).random(40_000) < 0.4)
    attempts = np.full_like(draws, 3)
    found = numbers_again(1, 2, attempts, draws, 8)
    for k in range(0, len(draws), 997):
        assert np.array_equal(found[k], by_numpy(1, 2, 3, int(draws[k]), 8))
