"""Bringing what was written to the disk itself, by whatever call of the system does that."""

from __future__ import annotations

import os

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["flush", "flush_data"]


def flush(descriptor: int) -> None:
    """Wait until all of an open file is on the disk, so that a loss of power does not take it.

    On macOS fsync leaves it in the memory of the disk: F_FULLFSYNC does not, where the file system has it.

    Raises
    ------
    OSError
        If that fails.
    """
    complete = getattr(fcntl, "F_FULLFSYNC", None)
    if complete is not None:
        try:
            fcntl.fcntl(descriptor, complete)
            return
        except OSError:  # a network's file system
            pass
    os.fsync(descriptor)


def flush_data(descriptor: int) -> None:
    """Bring a growing file on its way to the disk; what this leaves out (times of change) waits for the last `flush`.

    Raises
    ------
    OSError
        If that fails.
    """
    getattr(os, "fdatasync", os.fsync)(descriptor)  # macOS and Windows lack it
