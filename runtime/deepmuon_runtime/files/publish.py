"""Gives a complete file its name, so that under that name there is a complete file or none."""

from __future__ import annotations

import errno
import os
import stat
import warnings
from contextlib import suppress
from pathlib import Path

from deepmuon_runtime.errors import reason

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
        Whether a file of that name is replaced, whose mode it then takes.

    Raises
    ------
    FileExistsError
        If the name is taken (without `overwrite`): of two writers one wins and the other is told.
    OSError
        If the file system refuses otherwise. Then the name is not given.
    """
    if overwrite:
        with suppress(OSError):  # there is none, or no modes
            os.chmod(partial, stat.S_IMODE(os.stat(target).st_mode))
        os.replace(partial, target)
    else:
        _link(partial, target)
    _flush_name_to_disk(target)


def _link(source: Path, target: Path) -> None:
    """Give the complete file its name, unless the name is taken: then raise FileExistsError."""
    try:
        os.link(source, target)
    except OSError as error:
        if error.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK):
            raise
        # A file system without hard links (FAT, some network ones): reserve the name, then move over it.
        os.close(os.open(target, os.O_CREAT | os.O_EXCL))
        try:
            os.replace(source, target)
        except BaseException:
            os.unlink(target)
            raise


def _flush_name_to_disk(target: Path) -> None:
    """Make the name of a file survive a loss of power; warn where that fails, for the file is there."""
    try:
        descriptor = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except PermissionError:  # a folder that may be written but not read
        pass
    except OSError as error:
        warnings.warn(
            f"{target} is complete, but a loss of power now might take its name: {reason(error)}", stacklevel=2
        )
