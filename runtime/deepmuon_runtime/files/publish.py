"""Gives a complete file its name, so that under that name there is a complete file or none."""

from __future__ import annotations

import os
import stat
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from deepmuon_runtime.errors import reason
from deepmuon_runtime.files.folder import flush_names

__all__ = ["CONDITIONS", "publish"]

CONDITIONS: list[Callable[[], object]] = []
"""Called before a file gets its name: a program appends what shall keep a file from that, by raising FailedError."""


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
    for check in CONDITIONS:
        check()
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
    except FileExistsError:
        if not _is_same(source, target):  # over NFS a link that was made, and asked for again, is reported as taken
            raise
    except (OSError, AttributeError):  # FAT, file systems of networks, a system without links: each says it otherwise
        _move(source, target)


def _is_same(source: Path, target: Path) -> bool:
    try:
        return os.path.samestat(os.lstat(source), os.lstat(target))
    except OSError:
        return False


def _move(source: Path, target: Path) -> None:
    """Do the same without links: reserve the name, then move over it."""
    os.close(os.open(target, os.O_CREAT | os.O_EXCL))
    try:
        os.replace(source, target)
    except BaseException:
        os.unlink(target)
        raise


def _flush_name_to_disk(target: Path) -> None:
    """Make the name of a file survive a loss of power; warn where that fails, for the file is there."""
    try:
        flush_names(target.parent)
    except OSError as error:
        warnings.warn(
            f"{target} is complete, but a loss of power now might take its name: {reason(error)}", stacklevel=2
        )
