"""Random numbers of draws that were rejected and are made again.

Attempt 0 of a draw takes its latents, and what puts its muons on a target, from the rows that have these purposes. In
each later attempt a draw has a row of its own for both: its numbers begin at a counter of their own, so that the few
draws that are made again are made by themselves.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Philox
from numpy.typing import NDArray

from deepmuon_runtime.latents.philox import FOR_ATTEMPTS

__all__ = ["numbers_again"]

# Philox4x64-10 (see `philox`): the multipliers of the first and third number of a counter, and the steps of the key.
_MULTIPLIERS = np.array([[0xD2E7470EE14C6C93], [0xCA5A826395121157]], np.uint64)
_STEPS = np.array([[0x9E3779B97F4A7C15], [0xBB67AE8584CAA73B]], np.uint64)
_ROUNDS = 10
_LOW, _HALF = np.uint64(0xFFFFFFFF), np.uint64(32)
_LOW_OF_MULTIPLIERS, _HIGH_OF_MULTIPLIERS = _MULTIPLIERS & _LOW, _MULTIPLIERS >> _HALF

_AT_ONCE = 1 << 12  # counters that are computed side by side: they stay in the cache
_DENSE = 14  # a counter here takes as long as so many of numpy's in a row: 5 (Xeon) to 30 (EPYC)
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
            _row(key, attempt, draw * counters, counters)
            for attempt, draw in zip(attempts.tolist(), draws.tolist(), strict=True)
        ]
        words = np.concatenate(rows)
    else:
        first, span = int(draws[0]), int(draws[-1] - draws[0]) + 1
        is_dense = span < _DENSE * len(draws) and bool((attempts == attempts[0]).all())
        if is_dense:
            words = _row(key, int(attempts[0]), first * counters, span * counters)
            words = words.reshape(span, 4 * counters)[draws - first]
        else:
            each = (draws[:, None] * counters + np.arange(1, counters + 1)).ravel().astype(np.uint64)
            words = _philox(seed, stream, np.repeat(attempts, counters).astype(np.uint64), each)
    halves = words.astype("<u8", copy=False).view("<i4").reshape(len(draws), 8 * counters)
    halves &= -256
    halves |= 128
    found = halves[:, :size].astype(np.float32)
    found *= np.float32(2.0**-31)
    return found


def _row(key: int, attempt: int, first: int, counters: int) -> NDArray[np.uint64]:
    """Return the words at consecutive counters."""
    return Philox(key=key, counter=first + (attempt << 128) + (FOR_ATTEMPTS << 192)).random_raw(4 * counters)


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
        np.bitwise_and(even, _LOW, out=low)
        np.right_shift(even, _HALF, out=high)
        np.multiply(low, _LOW_OF_MULTIPLIERS, out=part)
        part >>= _HALF
        np.multiply(high, _LOW_OF_MULTIPLIERS, out=middle)
        middle += part
        np.bitwise_and(middle, _LOW, out=part)
        middle >>= _HALF
        low *= _HIGH_OF_MULTIPLIERS
        part += low
        part >>= _HALF
        high *= _HIGH_OF_MULTIPLIERS
        high += middle
        high += part
        even *= _MULTIPLIERS
        odd ^= key
        odd ^= high[::-1]
        even, odd = odd, even[::-1].copy()
        key = key + _STEPS  # modulo 2^64
    return np.stack([even[0], odd[0], even[1], odd[1]], axis=1)
