"""What the columns of a muon file must be: the same rules for the check and for everybody who reads.

A file may come from a stranger. HDF5 by itself would follow a column out of the file, wherever that leads, read zeros
where a chunk is missing, and ask for as much memory as the file tells it to.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from typing import Any

import h5py

from deepmuon_runtime.muon_file.damage import member
from deepmuon_runtime.muon_file.format import CHECKSUM, COLUMNS, OPTIONAL_COLUMNS, PLACE

__all__ = ["LARGEST_CHUNK", "columns_of", "missing_columns", "statement_defects", "storage_defects", "type_defects"]

LARGEST_CHUNK = 1 << 26
"""Bytes of the largest chunk: HDF5 has a whole one in memory, also where it is compressed to nearly nothing."""

_ALL = {**COLUMNS, **OPTIONAL_COLUMNS}


def columns_of(group: h5py.Group, version: int) -> dict[str, h5py.Dataset]:
    """Return the columns of the format that `/muons` itself holds.

    Parameters
    ----------
    group
        `/muons`.
    version
        The format version of the file: in version 1 there are no optional columns, whatever has their names.
    """
    names = _ALL if version > 1 else COLUMNS
    found = {name: member(group, name) for name in names}
    return {name: column for name, column in found.items() if isinstance(column, h5py.Dataset)}


def missing_columns(group: h5py.Group, columns: Mapping[str, h5py.Dataset], version: int) -> Iterator[str]:
    """Yield the names of the columns that should be there and are not, or are no columns."""
    needed = [*COLUMNS, *(PLACE if not columns.keys().isdisjoint(PLACE) else ())]
    optional = [name for name in OPTIONAL_COLUMNS if version > 1 and name in group and name not in needed]
    yield from (name for name in [*needed, *optional] if name not in columns)


def type_defects(column: h5py.Dataset, name: str) -> Iterator[str]:
    """Yield how a dataset is not of the type of the column that it should be, by its name."""
    dtype = _ALL[name][0]
    if column.dtype != dtype or column.ndim != 1:
        yield f"is {column.dtype} of shape {column.shape}, and should be {dtype} of one dimension"


def storage_defects(column: h5py.Dataset) -> Iterator[str]:
    """Yield what keeps a column of the right type from being read out of its own file."""
    if column.is_virtual:
        yield "keeps its numbers in other files"
    elif column.external:
        yield "keeps its numbers in a file that is not HDF5"
    elif column.chunks is None:
        if column.id.get_storage_size() != column.nbytes:
            yield f"holds {column.id.get_storage_size()} of its {column.nbytes} bytes"
    elif column.chunks[0] * column.dtype.itemsize > LARGEST_CHUNK:
        yield f"is stored in chunks of more than {LARGEST_CHUNK} bytes"
    elif column.id.get_num_chunks() != -(-len(column) // column.chunks[0]):
        yield f"holds {column.id.get_num_chunks()} of its {-(-len(column) // column.chunks[0])} chunks"
    is_plain = not (column.is_virtual or column.external or column.id.get_create_plist().get_nfilters())
    if is_plain and column.nbytes > os.path.getsize(column.file.filename):
        yield f"says that it holds {column.nbytes} bytes, more than its whole file"


def statement_defects(
    column: h5py.Dataset, attributes: Mapping[str, Any], name: str, count: int | None
) -> Iterator[str]:
    """Yield what is wrong with what a column says of itself.

    Parameters
    ----------
    column
        A dataset of one dimension.
    attributes
        Its attributes, as `format.stated` gives them.
    name
        Of the column.
    count
        How many muons the file says it has; None where it does not.
    """
    units, checksum = _ALL[name][1], attributes.get(CHECKSUM)
    if count is not None and len(column) != count:
        yield f"has {len(column)} muons, and the attribute count is {count}"
    if attributes.get("units") != units:
        yield f"has the units {attributes.get('units')!r}, and should have {units!r}"
    if not isinstance(checksum, int):
        yield f"has the checksum {checksum!r}, and should have a number, its CRC-32"
