"""Memory that was given back, which the process keeps for what it allocates next."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from deepmuon_runtime.memory_limit import is_limited

__all__ = ["keep_freed_memory"]

LARGEST_THRESHOLD = 32 << 20
"""Of glibc's: larger ones are not learned (mallopt(3), M_MMAP_THRESHOLD)."""


def keep_freed_memory() -> None:
    """Let freed memory stay in the process, up to 64 MB of it: muons are made in arrays that come and go all the time.

    For arrays of some 100 kB glibc asks the system for memory each time, and gives it back each time, until it has
    seen that a large one was freed. Then it keeps blocks up to that size, and twice as much of freed memory. So a large
    one, which is never touched, is freed here. Other C libraries do not mind, and where the addresses of the process
    are limited nothing is kept.
    """
    if not is_limited():
        with suppress(MemoryError):
            np.empty(LARGEST_THRESHOLD - (1 << 20), np.uint8)
