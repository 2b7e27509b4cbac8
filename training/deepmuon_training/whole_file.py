"""Files that are complete under their name, or not there."""

from __future__ import annotations

from pathlib import Path

from deepmuon_runtime.whole_file import whole_file

__all__ = ["write_whole"]


def write_whole(path: str | Path, contents: bytes, *, overwrite: bool = False) -> None:
    """Write a file under a temporary name in its folder, flush it to disk, then give it its name.

    Parameters
    ----------
    path
        The wanted file; its folder must exist.
    contents
        All of it.
    overwrite
        Whether an existing file is replaced.

    Raises
    ------
    RefusedError
        If the file exists (without `overwrite`), or its folder is missing or not writable.
    FailedError
        If it can't be written all the same, or another process has written it meanwhile.
    """
    with whole_file(path, overwrite=overwrite) as file:
        file.write(contents)
