"""The two ways in which a request for muons can end without muons."""

from __future__ import annotations

import errno
import os

__all__ = ["DeepMuonError", "FailedError", "RefusedError", "first_line", "reason", "shown"]


class DeepMuonError(Exception):
    """Base of the errors that DeepMuon raises on purpose; its text is one line meant for the user."""


class RefusedError(DeepMuonError):
    """Refused before anything started: bad arguments or input, no such model (exit code 2 of a command)."""


class FailedError(DeepMuonError):
    """Failed while running: disk full, a bad muon, a lost race for the output (exit code 1 of a command)."""


def first_line(error: Exception) -> str:
    """Return the first line of another library's error, or what sort of error it is where that has no text."""
    lines = str(error).strip().splitlines()
    return shown(lines[0], 300) if lines else type(error).__name__


def shown(text: str, most: int = 60) -> str:
    """Return a text of a stranger's file, cut so that an error stays a line that can be read."""
    return text if len(text) <= most else f"{text[:most]}... ({len(text)} characters)"


def reason(error: BaseException) -> str:
    """Return the cause of an error in one line."""
    if isinstance(error, OSError) and error.errno:
        return _of_lock(error.errno) if "unable to lock file" in str(error) else os.strerror(error.errno)
    return " ".join(str(error).split()) or type(error).__name__


def _of_lock(number: int) -> str:
    """Return why HDF5 could not lock a file, and when it may be read without a lock."""
    if number in (errno.EAGAIN, errno.EACCES):
        return (
            "another program has it open for writing; close it there, or set HDF5_USE_FILE_LOCKING=FALSE if that "
            "program writes no more"
        )
    return (
        f"it can't be locked ({os.strerror(number)}); set HDF5_USE_FILE_LOCKING=FALSE, which is safe where no program "
        "writes to the file"
    )
