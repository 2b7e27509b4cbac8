"""A mark that the writer of a file is alive: a lock that goes with its process, however that ends.

Windows has no such lock (flock), and some file systems have none: there nothing is known of a writer.
"""

from __future__ import annotations

import os
from contextlib import suppress

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["is_abandoned", "lock"]


def lock(descriptor: int) -> int | None:
    """Mark an open file as one whose writer is alive.

    Returns
    -------
    A further descriptor of the file, which keeps the mark, and the file itself, until it is closed; None on Windows,
    where a file that is open can't get another name.
    """
    if fcntl is None:
        return None
    with suppress(OSError):  # a file system without locks
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    return os.dup(descriptor)


def is_abandoned(path: str) -> bool:
    """Tell whether it is certain that the writer of a file is dead."""
    if fcntl is None:
        return False
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:  # locked, or no telling
        return False
    finally:
        os.close(descriptor)
    return True
