"""How many muons a live time gives."""

from __future__ import annotations

import math
from collections.abc import Callable

from deepmuon_runtime.latents.philox import FOR_COUNT, words

__all__ = ["poisson"]


def poisson(mean: float, seed: int, stream: int) -> int:
    """Draw the Poisson number that belongs to a seed and a stream.

    Up to a mean of 10 by inversion, above it by the transformed rejection PTRS of W. Hörmann, "The
    transformed rejection method for generating Poisson random variables", Insurance: Mathematics and
    Economics 12 (1993) 39. It is not numpy's because numpy does not promise that its own stays the same.

    Parameters
    ----------
    mean
        The expected number, finite and positive.
    seed, stream
        0 to 2^64 - 1; the number is drawn from words of their own, apart from the muons'.
    """

    def uniform(position: int) -> float:
        """Return a number strictly inside (0, 1)."""
        return ((int(words(seed, stream, FOR_COUNT, position, 1)[0]) >> 12) + 0.5) * 2.0**-52

    return _by_inversion(mean, uniform) if mean < 10 else _by_rejection(mean, uniform)


def _by_inversion(mean: float, uniform: Callable[[int], float]) -> int:
    remaining = uniform(0)
    number, probability = 0, math.exp(-mean)
    while remaining > probability and probability > 0:
        remaining -= probability
        number += 1
        probability *= mean / number
    return number


def _by_rejection(mean: float, uniform: Callable[[int], float]) -> int:
    # The names are the paper's.
    b = 0.931 + 2.53 * math.sqrt(mean)
    a = -0.059 + 0.02483 * b
    inverse_alpha = 1.1239 + 1.1328 / (b - 3.4)
    v_r = 0.9277 - 3.6224 / (b - 2)
    position = 0
    while True:
        u = uniform(position) - 0.5
        v = uniform(position + 1)
        position += 2
        us = 0.5 - abs(u)
        k = math.floor((2 * a / us + b) * u + mean + 0.43)
        if us >= 0.07 and v <= v_r:
            return k
        if k < 0 or (us < 0.013 and v > us):
            continue
        log_density = k * math.log(mean) - mean - math.lgamma(k + 1)
        if math.log(v * inverse_alpha / (a / (us * us) + b)) <= log_density:
            return k
