"""Checkpoints: what an interrupted fit goes on from, to the same result as an undisturbed one."""

from __future__ import annotations

import hashlib
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.files.whole import write_whole
from deepmuon_training.sealed import read_sealed, seal

__all__ = ["Checkpoint", "fingerprint"]

_SECONDS = 30.0


def fingerprint(*columns: NDArray[Any]) -> str:
    """Return a hash of numbers: other data of the same size have another."""
    digest = hashlib.sha256()
    for column in columns:
        digest.update(f"{column.dtype} {column.shape}".encode())
        digest.update(np.ascontiguousarray(column).data)
    return digest.hexdigest()


class Checkpoint:
    """A file with the state of a fit, and what fit that is.

    Parameters
    ----------
    path
        The file; None for a fit that keeps none.
    identity
        What tells the fit from others, by name: the data's fingerprint, the seed, settings. The number of threads is
        added, since others round otherwise.
    """

    def __init__(self, path: Path | None, **identity: object) -> None:
        self._path = path
        self._identity = {**identity, "number of threads": torch.get_num_threads()}
        self._saved = time.monotonic()

    @property
    def is_due(self) -> bool:
        """Whether half a minute has passed since the last one."""
        return self._path is not None and time.monotonic() - self._saved > _SECONDS

    def save(self, **parts: object) -> None:
        """Replace the file, if one is kept: numbers, texts, tensors, and lists and dictionaries of them."""
        if self._path is not None:
            write_whole(self._path, seal({"identity": self._identity, **parts}), overwrite=True)
            self._saved = time.monotonic()

    def load(self) -> dict[str, Any] | None:
        """Return the parts that were saved last, or None where there is no file.

        Raises
        ------
        RefusedError
            If the file is no checkpoint, damaged, or one of another fit.
        """
        if self._path is None or not self._path.exists():
            return None
        parts = read_sealed(self._path, "checkpoint of this version", "remove it")
        found = parts.pop("identity", {})
        for name, value in self._identity.items():
            if found.get(name) != value:
                what = "other data" if name == "data" else f"the {name} {found.get(name)}, not of {value}"
                raise RefusedError(f"{self._path} is a checkpoint of {what}: remove it, or keep the new ones elsewhere")
        return parts
