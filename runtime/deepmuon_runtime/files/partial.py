"""Files that are not complete yet: how they are called, and whose writer is dead.

A writer locks its file (flock) for as long as it lives. The lock goes with the process, however that ends.
"""

from __future__ import annotations

import fcntl
import os
import re
import secrets
import warnings
from contextlib import suppress
from pathlib import Path

__all__ = ["PARTIAL_SUFFIX", "hold", "new_partial", "warn_of_leftovers"]

PARTIAL_SUFFIX = ".deepmuon-partial"
"""Ends the name of a file that is still being written, or that a killed process left behind."""


def new_partial(target: Path) -> Path:
    """Return a temporary name, never the same, in the folder of the file that is to be."""
    return target.with_name(f"{target.name}.{secrets.token_hex(4)}{PARTIAL_SUFFIX}")


def hold(descriptor: int) -> None:
    """Mark an open file as one whose writer is alive."""
    with suppress(OSError):  # a file system without locks
        fcntl.flock(descriptor, fcntl.LOCK_EX)


def warn_of_leftovers(target: Path) -> None:
    """Warn of what killed writers of a file have left in its folder; those that are alive are passed over."""
    pattern = re.compile(re.escape(target.name) + r"\.[0-9a-f]{8}" + re.escape(PARTIAL_SUFFIX))
    names: list[str] = []
    with suppress(OSError), os.scandir(target.parent) as entries:  # a folder that may be written but not read
        names = sorted(entry.name for entry in entries if pattern.fullmatch(entry.name) and _is_abandoned(entry.path))
    if names:
        others = f" and {len(names) - 1} more" if len(names) > 1 else ""
        warnings.warn(
            f"in {target.parent} a run that was killed left {names[0]}{others}, not complete: to be deleted",
            stacklevel=2,
        )


def _is_abandoned(path: str) -> bool:
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
