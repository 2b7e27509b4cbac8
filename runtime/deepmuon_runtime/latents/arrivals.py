"""When muons come: a Poisson process, cut into slots that can be made one by one."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from functools import cache
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.latents.philox import FOR_COUNT, FOR_TIMES, words

__all__ = ["Arrivals"]

MEAN = 100_000
"""Muons that are expected in a slot."""

ROW = 1 << 17
"""Words that belong to a slot, more than it ever has muons: 98 standard deviations above the mean."""

GROUP = 1 << 10  # slots that are counted at once
REACH = 10  # standard deviations on both sides of the mean, beyond which a count has a probability of 1e-23


class Arrivals:
    """The times of muons that come independently at a constant rate, from 0 on.

    A slot lasts MEAN / rate seconds. It has a count of its own, and so many times, uniform and sorted. Muons are
    numbered slot by slot: the times of some need no others, and a shorter live time is the beginning of a longer one.

    Parameters
    ----------
    rate
        Muons per second.
    seed, stream
        0 to 2^64 - 1; the times have words of their own, apart from the muons'.
    live_time
        Seconds, after which there are no more.

    Attributes
    ----------
    seed, stream : int
        As given.
    count : int
        How many there are before the end.
    """

    def __init__(self, rate: float, seed: int, stream: int, live_time: float) -> None:
        self.seed, self.stream = seed, stream
        self._slot = MEAN / rate
        last = math.floor(live_time / self._slot)
        in_groups = [int(self._counts(group).sum()) for group in range(last // GROUP)]
        self._before = [0, *accumulate(in_groups)]  # muons before each group of slots
        of_last = self._times(last)
        whole = self._before[-1] + int(self._counts(last // GROUP)[: last % GROUP].sum())
        self.count = whole + int(np.searchsorted(of_last, live_time, side="left"))

    def times(self, numbers: range) -> NDArray[np.float64]:
        """Return when muons come, in seconds: float64 [n], none before that of the muon before it.

        Parameters
        ----------
        numbers
            Which muons, the next after the first.
        """
        found = [np.empty(0)]
        for slot, count, first in self.slots(numbers):
            found.append(self._times(slot, count)[max(numbers.start - first, 0) : numbers.stop - first])
        return np.concatenate(found)

    def slots(self, numbers: range) -> Iterator[tuple[int, int, int]]:
        """Yield the slots in which muons come, in order: which, how many muons it has, and the number of its first.

        Parameters
        ----------
        numbers
            Which muons, the next after the first.
        """
        group = bisect_right(self._before, numbers.start) - 1
        first = self._before[group]  # the number of the next slot's first muon
        while first < numbers.stop:
            for slot, count in enumerate(self._counts(group).tolist(), start=group * GROUP):
                if first < numbers.stop and first + count > numbers.start:
                    yield slot, count, first
                first += count
            group += 1

    def seconds(self, slot: int | NDArray[Any], place: NDArray[Any]) -> NDArray[np.float64]:
        """Return times from slots, and places in them of 0 to 2^53 - 1; arrays may be CuPy's."""
        times: NDArray[np.float64] = (slot + place * 2.0**-53) * self._slot
        return times

    @staticmethod
    def first_word(slot: int) -> int:
        """Return which word of its row makes a slot's first time, before they are sorted."""
        return slot * ROW

    def _counts(self, group: int) -> NDArray[np.int64]:
        """Return how many muons come in each slot of a group: int64 [GROUP]."""
        uniform = (words(self.seed, self.stream, FOR_COUNT, group * GROUP, GROUP) >> np.uint64(11)) * 2.0**-53
        lowest, cumulative = _distribution()
        return lowest + np.searchsorted(cumulative, uniform, side="right")

    def _times(self, slot: int, count: int | None = None) -> NDArray[np.float64]:
        """Return the times of a slot's muons, sorted: float64 [count]."""
        if count is None:
            count = int(self._counts(slot // GROUP)[slot % GROUP])
        moments = words(self.seed, self.stream, FOR_TIMES, self.first_word(slot), count)
        return self.seconds(slot, np.sort(moments) >> np.uint64(11))


@cache
def _distribution() -> tuple[int, NDArray[np.float64]]:
    """Return the lowest count, and the probabilities of at most it and each of the next.

    From the ratios of neighbours, mean / k, by the four basic operations alone: the same on every computer.
    """
    reach = REACH * math.isqrt(MEAN)
    above = np.cumprod(MEAN / np.arange(MEAN + 1, MEAN + reach + 1))
    below = np.cumprod(np.arange(MEAN, MEAN - reach, -1) / MEAN)
    cumulative = np.cumsum(np.concatenate([below[::-1], [1.0], above]))
    return MEAN - reach, cumulative[:-1] / cumulative[-1]
