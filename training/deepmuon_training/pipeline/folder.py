"""The folder of a run: it belongs to one set of settings and one sample, and to one process at a time."""

from __future__ import annotations

import fcntl
import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.files.partial import PARTIAL_SUFFIX
from deepmuon_runtime.files.whole import write_whole
from deepmuon_training.pipeline.settings_file import read_table, settings_from, to_toml

__all__ = ["SETTINGS", "run_folder"]

SETTINGS = "settings.toml"
"""Name of the file that holds the settings of the run, and the hash of its sample."""


@contextmanager
def run_folder(folder: Path, settings: Any, sample: Path) -> Iterator[None]:
    """Begin a run in a folder, or go on with it, and let no other process do so meanwhile.

    Parameters
    ----------
    folder
        Of the run; made if need be.
    settings
        A dataclass of settings, stored in the folder as TOML.
    sample
        The file that the run begins with, of which the folder knows the hash.

    Raises
    ------
    RefusedError
        If the folder holds something else, a run with other settings or of another sample, can't be written, or
        another process is working in it.
    """
    with sample.open("rb") as file:
        origin = f"# of the sample with SHA-256 {hashlib.file_digest(file, 'sha256').hexdigest()}"
    stored = folder / SETTINGS
    if not stored.exists():
        _make(folder)
        write_whole(stored, f"{origin}\n{to_toml(settings)}".encode())
    _compare(stored, origin, settings)
    with stored.open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until the process ends, however it does
        except BlockingIOError as error:
            raise RefusedError(
                f"another process is at work in {folder}: wait for it, or give another folder"
            ) from error
        except OSError:  # a file system without locks
            pass
        for leftover in folder.rglob(f"*{PARTIAL_SUFFIX}"):
            leftover.unlink()
        yield


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        strangers = [path.name for path in folder.iterdir() if not path.name.endswith(PARTIAL_SUFFIX)]
    except OSError as error:
        raise RefusedError(f"the folder {folder} can't be made or read: {reason(error)}") from error
    if strangers:
        raise RefusedError(f"{folder} holds no run, but {strangers[0]}: give a new or an empty folder")


def _compare(stored: Path, origin: str, settings: Any) -> None:
    """Refuse a stored file of another sample or with other settings."""
    if stored.read_text(encoding="utf-8").partition("\n")[0] != origin:
        raise RefusedError(f"{stored.parent} holds the run of another sample: give another folder")
    others = settings_from(type(settings)(), read_table(stored), str(stored))
    if others != settings:
        there, here = (set(to_toml(some).splitlines()) for some in (others, settings))
        differences = (
            f"{', '.join(sorted(there - here)) or 'nothing'} there, {', '.join(sorted(here - there)) or 'nothing'} here"
        )
        raise RefusedError(f"{stored.parent} holds a run with other settings ({differences}): give another folder")
