"""Virtual columns: HDF5 datasets whose numbers lie in other files, one part after the other.

Where a part's file is missing HDF5 reads the fill value, without an error: NaN, and 0 for the particle. It looks for it
in several folders, and keeps every file open that it has read from. So the numbers are read from the files here, and
from muon files alone, as a merge names them: a stranger's file can't have those of others read.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError, reason
from deepmuon_runtime.muon_file.columns import storage_defects, type_defects
from deepmuon_runtime.muon_file.damage import READ_ERRORS, member
from deepmuon_runtime.muon_file.format import check_format

__all__ = ["Source", "VirtualColumn", "create_virtual_column", "opened_source"]


class Source(NamedTuple):
    """A file that holds a part of a column.

    Parameters
    ----------
    path
        The file.
    column
        The name of the column, here and there.
    first, end
        Which muons of the virtual column it holds; all of the file's.
    """

    path: Path
    column: str
    first: int
    end: int


def create_virtual_column(
    group: h5py.Group, name: str, dtype: np.dtype[Any], sources: Sequence[Source]
) -> h5py.Dataset:
    """Create a column whose numbers lie in other files, which are found from the folder of its own.

    Parameters
    ----------
    group
        Where.
    name, dtype
        Of the column.
    sources
        The files that hold it, in the order of its muons and without gaps; their paths relative to the folder of
        the file of `group`.
    """
    layout = h5py.VirtualLayout((sources[-1].end,), dtype)
    for source in sources:
        file = str(source.path).replace("%", "%%")  # which HDF5 would replace by a number
        layout[source.first : source.end] = h5py.VirtualSource(
            file, f"muons/{source.column}", (source.end - source.first,), dtype
        )
    return group.create_virtual_dataset(name, layout, fillvalue=np.nan if dtype.kind == "f" else 0)


class VirtualColumn:
    """A virtual column that is read from its sources.

    Parameters
    ----------
    column
        A virtual dataset of one dimension.
    name
        Of the column that it is.
    progress
        Called with 0 before each source is read.

    Attributes
    ----------
    sources : list of Source
        In the order of their muons.

    Raises
    ------
    ValueError
        If it is not a row of whole columns of that name of other files, in order, without gaps, and named by paths
        relative to the folder of its own.
    """

    def __init__(self, column: h5py.Dataset, name: str, progress: Callable[[int], object] = lambda _: None) -> None:
        self._progress = progress
        self._dtype = column.dtype
        self._length = len(column)
        self.sources = sorted(_sources(column, name), key=lambda source: source.first)
        edges = [0, *(source.end for source in self.sources)]
        if [source.first for source in self.sources] != edges[:-1] or edges[-1] != self._length:
            raise ValueError("its sources leave gaps or overlap")

    def __len__(self) -> int:
        """Return the number of muons."""
        return self._length

    def __getitem__(self, span: slice) -> NDArray[Any]:
        """Read consecutive muons.

        Raises
        ------
        OSError, KeyError, ValueError
            If a source is missing or holds something else; the text names it.
        """
        first, end, _ = span.indices(self._length)
        values = np.empty(max(0, end - first), self._dtype)
        for source in self.sources:
            start, stop = max(first, source.first), min(end, source.end)
            if start < stop:
                self._progress(0)
                with opened_source(source) as column:
                    values[start - first : stop - first] = column[start - source.first : stop - source.first]
        return values


def _sources(column: h5py.Dataset, name: str) -> Iterator[Source]:
    folder = Path(os.path.realpath(column.file.filename)).parent  # as HDF5 does, links followed
    for mapping in column.virtual_sources():
        path = Path(mapping.file_name.replace("%%", "%"))
        if path.is_absolute():
            raise ValueError(f"its source {path} is not named by a path relative to the folder of the file")
        if mapping.dset_name.strip("/") != f"muons/{name}":
            raise ValueError(f"its source {path} is not the column {name} of a muon file")
        first, end = _row(mapping.vspace, len(column))
        if _row(mapping.src_space, end - first) != (0, end - first):
            raise ValueError(f"a part of {path} is mapped, and not a whole column")
        yield Source(folder / path, name, first, end)


def _row(selection: h5py.h5s.SpaceID, length: int) -> tuple[int, int]:
    """Return the first and the end of muons that are selected in a row, out of so many."""
    if selection.get_select_type() == h5py.h5s.SEL_ALL:
        return 0, length
    (low,), (high,) = selection.get_select_bounds()
    if selection.get_select_npoints() != high + 1 - low:
        raise ValueError("its mapping has holes")
    return int(low), int(high) + 1


@contextmanager
def opened_source(source: Source) -> Iterator[h5py.Dataset]:
    """Open the column of a source for reading; OSError, which names the file, if it is missing or something else."""
    if not source.path.is_file():  # a pipe would be waited for
        raise OSError(f"its source {source.path} is missing")
    try:
        with h5py.File(source.path, "r") as file:
            check_format(file, "it")
            column = member(file, f"muons/{source.column}")
            if not isinstance(column, h5py.Dataset) or column.shape != (source.end - source.first,):
                raise ValueError(f"there is no column of {source.end - source.first} muons")
            for defect in chain(type_defects(column, source.column), storage_defects(column)):
                raise ValueError(f"the column {defect}")
            yield column
    except (*READ_ERRORS, RefusedError) as error:
        raise OSError(f"its source {source.path} can't be read: {reason(error)}") from error
