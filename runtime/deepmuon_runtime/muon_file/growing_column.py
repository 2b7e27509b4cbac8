"""A column of a muon file while it is written: HDF5 gets whole chunks, as they shall lie in the file."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from deepmuon_runtime.muon_file.checksum import crc32

__all__ = ["GrowingColumn"]


class GrowingColumn:
    """A new column that values are appended to.

    HDF5 stores chunks that are handed to it ready made (`write_direct_chunk`) without a look at them: no selection, no
    fill values, no copy of its own, which would cost more time than the writing itself.

    Parameters
    ----------
    group
        Where the column is made.
    name
        Its name.
    dtype
        Its type in the file.
    chunk
        Values of a chunk.

    Attributes
    ----------
    dataset : h5py.Dataset
        The column; complete after `finish`.
    checksum : int
        The CRC-32 of the values so far.
    """

    def __init__(self, group: h5py.Group, name: str, dtype: np.dtype[Any], chunk: int) -> None:
        self.dataset = group.create_dataset(name, shape=(0,), maxshape=(None,), chunks=(chunk,), dtype=dtype)
        self.checksum = 0
        self._stored = 0
        self._begun = np.zeros(chunk, dtype)  # a chunk that the values so far do not fill
        self._waiting = 0

    def append(self, values: ArrayLike) -> None:
        """Take values of any number type after those that are there."""
        new = np.ascontiguousarray(values, self._begun.dtype)
        self.checksum = crc32(new.data, self.checksum)
        chunk = len(self._begun)
        done = 0
        while done < len(new):
            if not self._waiting and len(new) - done >= chunk:
                self._store(new[done : done + chunk], chunk)
                done += chunk
                continue
            taken = min(chunk - self._waiting, len(new) - done)
            self._begun[self._waiting : self._waiting + taken] = new[done : done + taken]
            self._waiting += taken
            done += taken
            if self._waiting == chunk:
                self._store(self._begun, chunk)
                self._waiting = 0

    def finish(self) -> None:
        """Store what does not fill a chunk; after it comes nothing."""
        if self._waiting:
            self._begun[self._waiting :] = 0
            self._store(self._begun, self._waiting)
            self._waiting = 0

    def _store(self, chunk: NDArray[Any], values: int) -> None:
        """Store a chunk, of which so many are values."""
        self.dataset.resize((self._stored + values,))
        self.dataset.id.write_direct_chunk((self._stored,), chunk.data)
        self._stored += values
