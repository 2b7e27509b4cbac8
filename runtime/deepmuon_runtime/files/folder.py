"""A folder that stays the same one when it gets another name, where the system can hold on to it."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from deepmuon_runtime.files.flush import flush

__all__ = ["Folder", "flush_names"]


class Folder:
    """A folder, held open so that a file in it is found again after the folder was renamed.

    Windows can't remove a file that way, and does not rename a folder with an open file in it: there its path is used.

    Parameters
    ----------
    path
        Of the folder.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._descriptor: int | None = None
        if {os.unlink, os.stat} <= os.supports_dir_fd:
            with suppress(OSError):  # a folder that may not be read, on a system without O_PATH
                self._descriptor = os.open(path, getattr(os, "O_PATH", os.O_RDONLY) | os.O_DIRECTORY)

    def contains(self, name: str, descriptor: int) -> bool:
        """Tell whether a name in it is that of an open file."""
        try:
            found = os.lstat(self._path / name) if self._descriptor is None else os.lstat(name, dir_fd=self._descriptor)
        except OSError:
            return False
        return os.path.samestat(found, os.fstat(descriptor))

    def remove(self, name: str) -> None:
        """Remove a file in it; do nothing if that is not there any more."""
        with suppress(OSError):  # never made, already in its place, or the folder is gone
            if self._descriptor is None:
                os.unlink(self._path / name)
            else:
                os.unlink(name, dir_fd=self._descriptor)

    def close(self) -> None:
        """Let go of the folder."""
        if self._descriptor is not None:
            descriptor, self._descriptor = self._descriptor, None
            os.close(descriptor)


def flush_names(path: Path) -> None:
    """Make the names in a folder survive a loss of power, as far as the system lets a folder be flushed.

    Raises
    ------
    OSError
        If the disk fails.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except PermissionError:  # a folder that may be written but not read; any folder, on Windows
        return
    try:
        flush(descriptor)
    finally:
        os.close(descriptor)
