"""Random numbers of draws that were rejected and are made again.

Attempt 0 of a draw takes its latents, and what puts its muons on a target, from the rows that have these purposes. In
each later attempt a draw has a row of its own for both: its numbers begin at a counter of their own, so that the few
draws that are made again are made by themselves.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.random import Philox
from numpy.typing import NDArray

from deepmuon_runtime.latents.philox import FOR_ATTEMPTS

__all__ = ["numbers_again"]

# Philox4x64-10 (see `philox`): the multipliers of the first and third number of a counter, and the steps of the key.
_MULTIPLIERS = np.array([[0xD2E7470EE14C6C93], [0xCA5A826395121157]], np.uint64)
_STEPS = np.array([[0x9E3779B97F4A7C15], [0xBB67AE8584CAA73B]], np.uint64)
_ROUNDS = 10
_LOW, _HALF = np.array(0xFFFFFFFF, np.uint64), np.array(32, np.uint64)  # arrays: numpy makes one of a number each time
_LOW_OF_MULTIPLIERS, _HIGH_OF_MULTIPLIERS = _MULTIPLIERS & _LOW, _MULTIPLIERS >> _HALF

_AT_ONCE = 1 << 13  # counters that are computed side by side: they stay in the cache
_DENSE = 6  # a counter here takes as long as so many of numpy's in a row, about
_ROW = 1 << 13  # counters that are taken in a row, of which some draws' are kept
_LARGE = 8  # counters of a draw, from which on each draw is made by itself


def numbers_again(
    seed: int, stream: int, attempts: NDArray[np.int64], draws: NDArray[np.int64], size: int
) -> NDArray[np.float32]:
    """Return the numbers of some draws at attempts from 1 on: like latents, uniform inside (-1, 1).

    Number j of draw d at attempt a is half j mod 8 of the four words at the counter (d c + j // 8 + 1, 0, a, 4), where
    c is the number of counters that a draw needs, size / 8 rounded up; made a latent as `philox.latents` says.

    Parameters
    ----------
    seed, stream
        0 to 2^64 - 1.
    attempts : int64 [n]
        Of each draw, from 1 on.
    draws : int64 [n]
        Which draws, in order; one may be there with several attempts.
    size
        Numbers of a draw.

    Returns
    -------
    float32 [n, size]
    """
    counters = -(-size // 8)
    key = seed + (stream << 64)
    if counters >= _LARGE:
        rows = [
            _philox_at(key, attempt, draw * counters).random_raw(4 * counters)
            for attempt, draw in zip(attempts.tolist(), draws.tolist(), strict=True)
        ]
        words = np.concatenate(rows)
    else:
        span = int(draws[-1] - draws[0]) + 1
        is_dense = span < _DENSE * len(draws) and bool((attempts == attempts[0]).all())
        if is_dense:
            words = _among_all(key, int(attempts[0]), draws, counters)
        else:
            each = (draws[:, None] * counters + np.arange(1, counters + 1)).ravel().astype(np.uint64)
            words = _philox(seed, stream, np.repeat(attempts, counters).astype(np.uint64), each)
    halves = words.astype("<u8", copy=False).view("<i4").reshape(len(draws), 8 * counters)
    halves &= -256
    halves |= 128
    found = halves[:, :size].astype(np.float32)
    found *= np.float32(2.0**-31)
    return found


def _philox_at(key: int, attempt: int, counter: int) -> Philox:
    """Return a generator whose first words are those after a counter."""
    return Philox(key=key, counter=counter + (attempt << 128) + (FOR_ATTEMPTS << 192))


def _among_all(key: int, attempt: int, draws: NDArray[np.int64], counters: int) -> NDArray[np.uint64]:
    """Return the words of draws, in order, from those of all draws between the first and the last: [n, 4 counters]."""
    first, step = int(draws[0]), _ROW // counters
    philox = _philox_at(key, attempt, first * counters)
    words = np.empty((len(draws), 4 * counters), np.uint64)
    starts = range(first, int(draws[-1]) + 1, step)
    bounds = [*np.searchsorted(draws, starts).tolist(), len(draws)]
    for start, (begin, end) in zip(starts, pairwise(bounds), strict=True):
        row = philox.random_raw(4 * counters * step).reshape(step, -1)
        row.take(draws[begin:end] - start, axis=0, out=words[begin:end], mode="clip")  # which needs no copy
    return words


def _philox(seed: int, stream: int, attempts: NDArray[np.uint64], counters: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the four words at each counter (counter, 0, attempt, purpose): uint64 [n, 4]."""
    words = np.empty((len(counters), 4), np.uint64)
    for start in range(0, len(counters), _AT_ONCE):
        some = slice(start, start + _AT_ONCE)
        words[some] = _side_by_side(seed, stream, attempts[some], counters[some])
    return words


def _side_by_side(
    seed: int, stream: int, attempts: NDArray[np.uint64], counters: NDArray[np.uint64]
) -> NDArray[np.uint64]:
    even = np.stack([counters, attempts])
    odd = np.zeros_like(even)
    odd[1] = FOR_ATTEMPTS
    key = np.array([[seed], [stream]], np.uint64)
    low, middle, high, part = (np.empty_like(even) for _ in range(4))
    for _ in range(_ROUNDS):
        # The product of 64 x 64 bits, from four of 32 x 32.
        np.bitwise_and(even, _LOW, low)
        np.right_shift(even, _HALF, high)
        np.multiply(low, _LOW_OF_MULTIPLIERS, part)
        np.right_shift(part, _HALF, part)
        np.multiply(high, _LOW_OF_MULTIPLIERS, middle)
        np.add(middle, part, middle)
        np.bitwise_and(middle, _LOW, part)
        np.right_shift(middle, _HALF, middle)
        np.multiply(low, _HIGH_OF_MULTIPLIERS, low)
        np.add(part, low, part)
        np.right_shift(part, _HALF, part)
        np.multiply(high, _HIGH_OF_MULTIPLIERS, high)
        np.add(high, middle, high)
        np.add(high, part, high)
        np.multiply(even, _MULTIPLIERS, even)
        np.bitwise_xor(odd, key, odd)
        np.bitwise_xor(odd, high[::-1], odd)
        even, odd = odd, even[::-1]
        key = key + _STEPS  # modulo 2^64
    return np.stack([even[0], odd[0], even[1], odd[1]], axis=1)
