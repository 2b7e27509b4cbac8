"""Files that are complete under their name, or not there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from deepmuon_runtime.errors import FailedError
from deepmuon_runtime.files.partial import hold, new_partial, warn_of_leftovers
from deepmuon_runtime.files.publish import publish
from deepmuon_runtime.muon_file.damage import reason
from deepmuon_runtime.muon_file.file import check_output

__all__ = ["whole_file"]


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
    target = check_output(path, overwrite)
    warn_of_leftovers(target)
    partial = new_partial(target)
    try:
        with partial.open("xb") as file:
            hold(file.fileno())
            yield file
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
