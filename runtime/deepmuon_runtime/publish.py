"""Gives a complete file its name, so that under that name there is a complete file or none."""

from __future__ import annotations

import errno
import os
from pathlib import Path

__all__ = ["publish"]


def publish(partial: Path, target: Path, overwrite: bool) -> None:
    """Give a file that is complete and on disk its name, for good.

    Parameters
    ----------
    partial
        The file's temporary name, in the folder of `target`. It may remain: whoever made it removes it.
    target
        The name it gets.
    overwrite
        Whether a file of that name is replaced.

    Raises
    ------
    FileExistsError
        If the name is taken (without `overwrite`): of two writers one wins and the other is told.
    OSError
        If the file system refuses otherwise.
    """
    if overwrite:
        os.replace(partial, target)
    else:
        _link(partial, target)
    _flush_names_to_disk(target.parent)


def _link(source: Path, target: Path) -> None:
    """Give the complete file its name, unless the name is taken: then raise FileExistsError."""
    try:
        os.link(source, target)
    except OSError as error:
        if error.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK):
            raise
        # A file system without hard links (FAT, some network ones): reserve the name, then move over it.
        os.close(os.open(target, os.O_CREAT | os.O_EXCL))
        os.replace(source, target)


def _flush_names_to_disk(folder: Path) -> None:
    """Make the names in a folder survive a loss of power."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
