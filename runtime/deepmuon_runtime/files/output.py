"""Whether a file can be written where it is wanted."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from deepmuon_runtime.errors import RefusedError, reason

__all__ = ["check_output"]


def check_output(path: str | Path, overwrite: bool = False, inputs: Iterable[str | Path] = ()) -> Path:
    """Tell whether a file can be written at `path`, before the work for it begins.

    Parameters
    ----------
    path
        The wanted file; a symbolic link is followed.
    overwrite
        Whether a file that exists may be replaced.
    inputs
        Files that are read for it, which are never replaced.

    Returns
    -------
    The absolute path, links followed.

    Raises
    ------
    RefusedError
        If something other than a file is there, or one of `inputs`, or a file and `overwrite` is false, or its folder
        is missing or not writable.
    """
    try:
        target = Path(os.path.realpath(path))
        if target.is_dir():
            raise RefusedError(f"{path} is a folder: give the name of a file in it")
        if target.is_symlink():  # after all links were followed
            raise RefusedError(f"{path} is a symbolic link that leads back to itself: give another name")
        if Path(path).exists() and not Path(path).is_file():  # that of /dev/stdout leads to a name that is none
            raise RefusedError(f"{path} is a device or a pipe: give the name of a regular file")
        if target.exists() and any(os.path.exists(read) and target.samefile(read) for read in inputs):
            raise RefusedError(f"{path} is read here, and would be replaced: give the output another name")
        if target.exists() and not overwrite:
            raise RefusedError(
                f"{path} exists already: choose another name, or ask for it to be overwritten (--overwrite)"
            )
        if not target.parent.is_dir():
            raise RefusedError(f"{path} can't be written: there is no folder {target.parent}")
        if not os.access(target.parent, os.W_OK | os.X_OK):
            raise RefusedError(f"{path} can't be written: the folder {target.parent} is not writable")
    except (OSError, ValueError) as error:  # a name too long, a null byte, a folder that may not be searched
        raise RefusedError(f"{path} can't be written: {reason(error)}") from error
    return target
