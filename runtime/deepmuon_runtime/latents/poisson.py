"""How many muons a live time gives."""

from __future__ import annotations

import math

from deepmuon_runtime.latents.philox import COUNT_STREAM, words

__all__ = ["poisson"]


def poisson(mean: float, seed: int) -> int:
    """Draw the Poisson number that belongs to a seed.

    Up to a mean of 10 by inversion, above it by the transformed rejection PTRS of W. Hörmann, "The
    transformed rejection method for generating Poisson random variables", Insurance: Mathematics and
    Economics 12 (1993) 39. It is not numpy's because numpy does not promise that its own stays the same.

    Parameters
    ----------
    mean
        The expected number, finite and positive.
    seed
        0 to 2^64 - 1; the number is drawn from a stream of its own, apart from the muons'.
    """
    return _by_inversion(mean, seed) if mean < 10 else _by_rejection(mean, seed)


def _uniform(seed: int, position: int) -> float:
    """Return number `position` of the seed's uniform numbers, strictly inside (0, 1)."""
    return ((int(words(seed, COUNT_STREAM, position, 1)[0]) >> 12) + 0.5) * 2.0**-52


def _by_inversion(mean: float, seed: int) -> int:
    remaining = _uniform(seed, 0)
    number, probability = 0, math.exp(-mean)
    while remaining > probability and probability > 0:
        remaining -= probability
        number += 1
        probability *= mean / number
    return number


def _by_rejection(mean: float, seed: int) -> int:
    # The names are the paper's.
    b = 0.931 + 2.53 * math.sqrt(mean)
    a = -0.059 + 0.02483 * b
    inverse_alpha = 1.1239 + 1.1328 / (b - 3.4)
    v_r = 0.9277 - 3.6224 / (b - 2)
    position = 0
    while True:
        u = _uniform(seed, position) - 0.5
        v = _uniform(seed, position + 1)
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
