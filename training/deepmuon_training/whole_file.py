"""Files that are complete under their name, or not there."""

from __future__ import annotations

from pathlib import Path

from deepmuon_runtime.files.whole import whole_file

__all__ = ["write_whole"]


def write_whole(path: str | Path, contents: bytes, *, overwrite: bool = False) -> None:
    """Write a file that is complete under its name, or not there; arguments and errors are those of `whole_file`.

    Parameters
    ----------
    path, overwrite
        As for `deepmuon_runtime.files.whole.whole_file`.
    contents
        All of the file.

    Raises
    ------
    RefusedError, FailedError
        As `deepmuon_runtime.files.whole.whole_file` raises them.
    """
    with whole_file(path, overwrite=overwrite) as file:
        file.write(contents)
