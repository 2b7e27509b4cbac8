"""What the files of a run were when they were written: SHA-256 by name, as `sha256sum -c` reads them."""

from __future__ import annotations

import hashlib
from pathlib import Path

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.files.whole import write_whole

__all__ = ["CHECKSUMS", "check", "record"]

CHECKSUMS = "SHA256SUMS"
"""Name of the file beside those that it is about."""


def record(path: Path) -> None:
    """Note what a file is, which was written just now.

    Raises
    ------
    FailedError
        If that can't be written.
    """
    sums = {**_read(path.parent), path.name: _digest(path)}
    lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(sums.items()))
    write_whole(path.parent / CHECKSUMS, lines.encode(), overwrite=True)


def check(path: Path) -> None:
    """Tell whether a file is what was written; one of which nothing was noted is taken as it is, and noted.

    A run that is killed between the two leaves such a file: complete, since it has its name.

    Raises
    ------
    RefusedError
        If it is another.
    """
    known = _read(path.parent).get(path.name)
    if known is None:
        record(path)
    elif known != _digest(path):
        raise RefusedError(
            f"{path} is damaged or was changed: it is not what the run wrote; remove it, and it is made again"
        )


def _read(folder: Path) -> dict[str, str]:
    """Return the digests by name; none where there is no such file."""
    try:
        lines = (folder / CHECKSUMS).read_text(encoding="utf-8").splitlines()
    except FileNotFoundError:
        return {}
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines)}


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
