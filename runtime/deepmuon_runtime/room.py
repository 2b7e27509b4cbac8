"""Whether disk and memory hold what is asked for, told before the work begins."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from deepmuon_runtime.errors import RefusedError

__all__ = ["check_disk", "check_memory"]


def check_disk(folder: Path, size: int, what: str) -> None:
    """Refuse what does not fit on a disk.

    Parameters
    ----------
    folder
        A folder on it.
    size
        Bytes, at least.
    what
        Begins the error: "1,000 muons".

    Raises
    ------
    RefusedError
        If fewer are free.
    """
    free = shutil.disk_usage(folder).free
    if size > free:
        raise RefusedError(f"{what} need {_readable(size)}, and {folder} has {_readable(free)} free")


def check_memory(size: int, what: str, instead: str) -> None:
    """Refuse what this machine can't hold in memory. Systems promise more than they have, and end who believes them.

    Parameters
    ----------
    size
        Bytes.
    what, instead
        Begin and end the error: what does not fit, and what to do.

    Raises
    ------
    RefusedError
        If the machine has less, where it can be asked.
    """
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # a system without sysconf, or one that does not know
        return
    if size > memory:
        raise RefusedError(f"{what} do not fit in the {_readable(memory)} of memory: {instead}")


def _readable(size: float) -> str:
    for unit in ("bytes", "kB", "MB", "GB", "TB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} PB"
