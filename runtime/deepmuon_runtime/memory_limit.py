"""What a limit of a process's memory (ulimit -v, a batch system's) leaves for threads."""

from __future__ import annotations

import os
from pathlib import Path

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

__all__ = ["affordable"]

PER_THREAD = 90_000_000  # bytes of addresses: a stack, and 64 MiB that the C library sets aside for what it allocates
FOR_ALL = 60_000_000  # the threads that write, HDF5, the muons on their way


def affordable(threads: int) -> int:
    """Return how many threads may be started, which is fewer than asked for where the memory is limited.

    A thread that lacks memory when it starts is no error that could be caught: the C library ends the process.

    Raises
    ------
    MemoryError
        If there is none left for a single one.
    """
    if resource is None:
        return threads
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return threads
    left = limit - _in_use() - FOR_ALL
    if left < 0:
        raise MemoryError
    return max(1, min(threads, left // PER_THREAD))


def _in_use() -> int:
    """Return how many bytes of addresses the process uses, 0 where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 0
