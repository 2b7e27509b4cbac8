"""The seeds of a pipeline's steps, all derived from one.

A step's seed is the first 32-bit word of `numpy.random.SeedSequence` with the pipeline's seed as its entropy and with
the spawn key (position of the step's kind in `KINDS`, number of its layer from 0 at the top). So no two steps have the
same random numbers, and a step has the same ones whatever was done before it.
"""

from __future__ import annotations

from numpy.random import SeedSequence

__all__ = ["KINDS", "step_seed"]

KINDS = ("fit", "draw", "transport", "score")
"""The kinds of steps that need random numbers; a new one is added at the end."""


def step_seed(seed: int, kind: str, layer: int) -> int:
    """Return the seed of a step.

    Parameters
    ----------
    seed
        Of the pipeline, 0 or more.
    kind
        One of `KINDS`.
    layer
        Number of the layer, 0 at the top.

    Returns
    -------
    int
        0 to 2^32 - 1.

    Examples
    --------
    >>> step_seed(1, "transport", 1), step_seed(1, "transport", 2)
    (1451639359, 3207221960)
    """
    sequence = SeedSequence(seed, spawn_key=(KINDS.index(kind), layer))
    return int(sequence.generate_state(1)[0])
