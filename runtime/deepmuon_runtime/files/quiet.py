"""A file that keeps its write errors to itself."""

from __future__ import annotations

import io
from typing import Any

__all__ = ["QuietFile"]


class QuietFile(io.FileIO):
    """A new file for HDF5 to write to, which never hears of a full disk.

    HDF5 ends the process by a segmentation fault when a write fails and the file is closed after it. This
    file tells it that all is well and remembers the first error for the caller, who looks at `error` after
    each operation and then throws the file away.

    Parameters
    ----------
    path
        The file to be created; FileExistsError if there is one.

    Attributes
    ----------
    error : OSError or None
        The first error; nothing is written after it.
    """

    error: OSError | None

    def __init__(self, path: str) -> None:
        super().__init__(path, "x+")
        self.error = None

    def write(self, data: Any, /) -> int:
        """Write all of `data`, or nothing more once a write has failed; return its length in bytes."""
        view = memoryview(data).cast("B")
        done = 0
        while self.error is None and done < len(view):
            try:
                done += super().write(view[done:])
            except OSError as error:
                self.error = error
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length, with errors remembered in the same way."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0
