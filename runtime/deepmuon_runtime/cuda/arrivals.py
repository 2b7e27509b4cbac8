"""The times of muons, made and sorted in a GPU's memory."""

from __future__ import annotations

from itertools import islice
from typing import Any

import numpy as np

from deepmuon_runtime.cuda.kernels import WHERE_BITS, Kernels
from deepmuon_runtime.latents.arrivals import Arrivals

__all__ = ["fill_times"]

AT_ONCE = 64  # slots that are sorted together: some six million times


def fill_times(times: Any, arrivals: Arrivals, numbers: range, kernels: Kernels) -> None:
    """Say when muons come, as `Arrivals.times` does, to the bit.

    A slot stands above the bits that say where in it a muon comes. So slots are sorted together, and stay in order.

    Parameters
    ----------
    times : float64 [n], CuPy's
        What is to be filled.
    arrivals, numbers
        Whose times, and which.
    kernels
        What makes the words.
    """
    import cupy

    slots = arrivals.slots(numbers)
    while some := list(islice(slots, AT_ONCE)):
        first_slot, _, first = some[0]
        moments = cupy.empty(sum(count for _, count, _ in some), np.uint64)
        done = 0
        for slot, count, _ in some:
            part = moments[done : done + count]
            kernels.fill_moments(part, arrivals.seed, arrivals.stream, arrivals.first_word(slot), slot - first_slot)
            done += count
        moments.sort()
        where = moments & np.uint64(2**WHERE_BITS - 1)
        seconds = arrivals.seconds((moments >> np.uint64(WHERE_BITS)) + np.uint64(first_slot), where)
        begin = max(first, numbers.start)
        part = times[begin - numbers.start : first + len(seconds) - numbers.start]
        part[:] = seconds[begin - first : begin - first + len(part)]
