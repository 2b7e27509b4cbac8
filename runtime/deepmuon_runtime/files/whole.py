"""Files that are complete under their name, or not there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from deepmuon_runtime.files.flush import flush
from deepmuon_runtime.files.partial import PartialFile

__all__ = ["whole_file", "write_whole"]


@contextmanager
def whole_file(path: str | Path, *, overwrite: bool = False) -> Iterator[BinaryIO]:
    """Open a new file, which gets its name when the body of the `with` statement ends; if it raises, nothing is left.

    Parameters
    ----------
    path
        The wanted file; its folder must exist.
    overwrite
        Whether an existing file is replaced.

    Raises
    ------
    RefusedError
        If the file exists (without `overwrite`), or its folder is missing or not writable.
    FailedError
        If it can't be written all the same, or another process has written it meanwhile.
    """
    partial = PartialFile(path, overwrite)
    partial.begin()
    try:
        with partial.failures():
            with partial.path.open("xb") as file:
                partial.hold(file.fileno())
                yield file
                file.flush()
                flush(file.fileno())
            partial.publish()
    finally:
        partial.remove()


def write_whole(path: str | Path, contents: bytes, *, overwrite: bool = False) -> None:
    """Write a file that is complete under its name, or not there; arguments and errors are those of `whole_file`.

    Parameters
    ----------
    path, overwrite
        As for `whole_file`.
    contents
        All of the file.

    Raises
    ------
    RefusedError, FailedError
        As `whole_file` raises them.
    """
    with whole_file(path, overwrite=overwrite) as file:
        file.write(contents)
