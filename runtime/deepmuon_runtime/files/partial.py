"""Files that are not complete yet: how they are called, how they get their name, and whose writer is dead.

A file is written under a temporary name in its own folder (`NAME.<8 hex digits>.deepmuon-partial`), flushed to disk by
its writer, and only then linked to its name: under that name there is a complete file or none. A writer locks its file
(flock) for as long as it lives. The lock goes with the process, however that ends.
"""

from __future__ import annotations

import os
import re
import secrets
import warnings
import weakref
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from deepmuon_runtime.errors import FailedError, reason
from deepmuon_runtime.files.folder import Folder
from deepmuon_runtime.files.lock import is_abandoned, lock
from deepmuon_runtime.files.output import check_output
from deepmuon_runtime.files.publish import publish

__all__ = ["PARTIAL_SUFFIX", "PartialFile"]

PARTIAL_SUFFIX = ".deepmuon-partial"
"""Ends the name of a file that is still being written, or that a killed process left behind."""


class PartialFile:
    """A file until it is complete: its temporary name, and the name that it gets.

    Parameters
    ----------
    path
        The wanted file; a symbolic link is followed.
    overwrite
        Whether an existing file is replaced, at the moment when the new one is complete.

    Attributes
    ----------
    target : Path
        The absolute path of the wanted file, links followed.
    path : Path
        The temporary one, never the same, in its folder.

    Raises
    ------
    RefusedError
        As `deepmuon_runtime.files.output.check_output`.
    """

    def __init__(self, path: str | Path, overwrite: bool = False) -> None:
        self.target = check_output(path, overwrite)
        self.path = self.target.with_name(f"{self.target.name}.{secrets.token_hex(4)}{PARTIAL_SUFFIX}")
        self._overwrite = overwrite

    def begin(self) -> None:
        """Warn of what dead writers left, and see to it that this one leaves nothing: before the first byte."""
        _warn_of_leftovers(self.target)
        self._folder = Folder(self.target.parent)
        self._held: list[int] = []
        # At the latest when the process ends.
        self._remove = weakref.finalize(self, _remove, self._folder, self.path.name, self._held)

    def hold(self, descriptor: int) -> None:
        """Mark the temporary file, which is open, as one whose writer is alive, and remember which file it is."""
        held = lock(descriptor)
        if held is not None:
            self._held.append(held)

    def publish(self) -> None:
        """Give the file, which is complete, on disk and closed, its name.

        Raises
        ------
        FailedError
            If it is not what lies under the temporary name any more.
        OSError
            As `publish.publish`.
        """
        if any(not self._folder.contains(self.path.name, descriptor) for descriptor in self._held):
            raise FailedError(f"{self.target} was not written: {self.path.name} was exchanged or removed meanwhile")
        publish(self.path, self.target, self._overwrite)

    def remove(self) -> None:
        """Take the temporary name away, where it is still there."""
        self._remove()

    @contextmanager
    def failures(self) -> Iterator[None]:
        """Turn what a file system says of the body of a `with` statement into one line.

        Raises
        ------
        FailedError
            If the file can't be written, or another process has written it meanwhile.
        """
        try:
            yield
        except FileExistsError as error:
            raise FailedError(f"{self.target} was written by another process meanwhile: kept as it is") from error
        except OSError as error:
            raise FailedError(f"{self.target} was not written: {reason(error)}") from error


def _warn_of_leftovers(target: Path) -> None:
    """Warn of what killed writers of a file have left in its folder; those that are alive are passed over."""
    pattern = re.compile(re.escape(target.name) + r"\.[0-9a-f]{8}" + re.escape(PARTIAL_SUFFIX))
    names: list[str] = []
    with suppress(OSError), os.scandir(target.parent) as entries:  # a folder that may be written but not read
        names = sorted(entry.name for entry in entries if pattern.fullmatch(entry.name) and is_abandoned(entry.path))
    if names:
        others = f" and {len(names) - 1} more" if len(names) > 1 else ""
        warnings.warn(
            f"in {target.parent} a run that was killed left {names[0]}{others}, not complete: to be deleted",
            stacklevel=2,
        )


def _remove(folder: Folder, name: str, held: list[int]) -> None:
    if all(folder.contains(name, descriptor) for descriptor in held):  # else it is somebody else's by now
        folder.remove(name)
    folder.close()
    for descriptor in held:
        os.close(descriptor)
