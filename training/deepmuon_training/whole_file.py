"""Files that are complete under their name, or not there."""

from __future__ import annotations

import os
import secrets
from contextlib import suppress
from pathlib import Path

from deepmuon_runtime.errors import FailedError
from deepmuon_runtime.muon_file import PARTIAL_SUFFIX, check_output, reason
from deepmuon_runtime.publish import publish

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
    target = check_output(path, overwrite)
    partial = target.with_name(f"{target.name}.{secrets.token_hex(4)}{PARTIAL_SUFFIX}")
    try:
        with partial.open("xb") as file:
            file.write(contents)
            file.flush()
            os.fsync(file.fileno())
        publish(partial, target, overwrite)
    except FileExistsError as error:
        raise FailedError(f"{target} was written by another process meanwhile: kept as it is") from error
    except OSError as error:
        raise FailedError(f"{target} was not written: {reason(error)}") from error
    finally:
        with suppress(OSError):  # never made, or already in its place
            partial.unlink()
