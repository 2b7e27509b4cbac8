"""The format of a muon file, version 2.

::

    /                       format="deepmuon-muons", format_version=2
    /muons/kinetic_energy   float32  units="GeV"
    /muons/u, v, w          float32  units="1"
    /muons/pdg_id           int8     13 = mu-, -13 = mu+
    /muons/x, y, z          float32  units="m"    together, where the file knows places
    /muons/time             float64  units="s"    where it knows times
    /muons attributes       count, depth_m, medium, created, created_by, and what else is known

Each column has the attribute crc32, the CRC-32 of its bytes one after the other; `/muons` has attributes_crc32, that of
its other attributes (`checksum.attributes_crc32`). Version 1, which is read too, had neither that nor x, y, z and time.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from deepmuon_runtime.errors import RefusedError

__all__ = [
    "ATTRIBUTES_CHECKSUM",
    "BYTES_PER_MUON",
    "CHECKSUM",
    "COLUMNS",
    "FORMAT",
    "FORMAT_VERSION",
    "OPTIONAL_COLUMNS",
    "PLACE",
    "bytes_per_muon",
    "check_format",
    "column_types",
    "python_value",
    "stated",
]

FORMAT = "deepmuon-muons"
FORMAT_VERSION = 2
_READ = (1, 2)

CHECKSUM = "crc32"
"""The attribute of a column with the CRC-32 of its bytes."""

ATTRIBUTES_CHECKSUM = "attributes_crc32"
"""The attribute of `/muons` with the CRC-32 of its others."""

COLUMNS: dict[str, tuple[np.dtype[Any], str]] = {
    "kinetic_energy": (np.dtype("<f4"), "GeV"),
    "u": (np.dtype("<f4"), "1"),
    "v": (np.dtype("<f4"), "1"),
    "w": (np.dtype("<f4"), "1"),
    "pdg_id": (np.dtype("i1"), "1"),
}
"""Type and unit of each dataset that `/muons` always has."""

PLACE = ("x", "y", "z")
"""The columns of a muon's place, all or none of which are there."""

OPTIONAL_COLUMNS: dict[str, tuple[np.dtype[Any], str]] = {
    **dict.fromkeys(PLACE, (np.dtype("<f4"), "m")),
    "time": (np.dtype("<f8"), "s"),
}
"""Type and unit of each dataset that it may have, from version 2 on."""

LARGEST_ATTRIBUTE = 1 << 20
"""Bytes that an attribute may say it has: HDF5 asks for so many before it looks for them."""


def bytes_per_muon(columns: Iterable[str]) -> int:
    """Return how many bytes of each muon the named columns hold."""
    return sum({**COLUMNS, **OPTIONAL_COLUMNS}[name][0].itemsize for name in columns)


BYTES_PER_MUON = bytes_per_muon(COLUMNS)
"""Bytes of a muon without optional columns."""


def column_types(names: object, path: object) -> dict[str, np.dtype[Any]]:
    """Return the types of named columns in the order of a muon file; RefusedError unless they may be those of one."""
    every = {**COLUMNS, **OPTIONAL_COLUMNS}
    if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
        raise RefusedError(f"{path} does not say which columns it has")
    found = {name: dtype for name, (dtype, _) in every.items() if name in names}
    if (
        len(found) != len(names)
        or not COLUMNS.keys() <= found.keys()
        or len(found.keys() & set(PLACE)) not in (0, len(PLACE))
    ):
        raise RefusedError(f"{path} has the columns {', '.join(names)[:200]}, which are none of a muon file")
    return found


def check_format(file: h5py.File, path: str | Path) -> int:
    """Return the format version of a muon file; raise RefusedError unless it is one of a version that is read."""
    form, form_version = (_attribute(file, name) for name in ("format", "format_version"))
    if form != FORMAT:
        raise RefusedError(f"{path} is no muon file: it lacks the attribute format={FORMAT!r}")
    if form_version not in _READ:
        raise RefusedError(
            f"{path} has format version {form_version}, and this release reads versions {' and '.join(map(str, _READ))}"
        )
    return int(form_version)


def stated(node: h5py.HLObject) -> dict[str, Any]:
    """Return the attributes of a group or column as Python's str, int, float, bool, or lists of them.

    Raises
    ------
    ValueError
        If a name or a text is no UTF-8, or a value says that it is larger than a megabyte; other errors are those
        of h5py (`damage.READ_ERRORS`).
    """
    values = {}
    for name in node.attrs:
        if not isinstance(name, str) or not _is_utf8(name):
            raise ValueError(f"an attribute has the name {ascii(name)[:80]}, which is no UTF-8")
        values[name] = _attribute(node, name)
        if not _is_utf8(values[name]):
            raise ValueError(f"the attribute {name} holds a text that is no UTF-8")
    return values


def python_value(value: Any) -> Any:
    """Return an attribute as Python's str, int, float, bool, or a list of them."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [python_value(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


def _attribute(node: h5py.HLObject, name: str) -> Any:
    """Return an attribute, None if there is none; ValueError if it says that it is larger than a megabyte."""
    if name not in node.attrs:
        return None
    attribute = h5py.h5a.open(node.id, name.encode())
    if attribute.get_space().get_simple_extent_npoints() * attribute.get_type().get_size() > LARGEST_ATTRIBUTE:
        raise ValueError(f"the attribute {name} is larger than a megabyte")
    return python_value(node.attrs[name])


def _is_utf8(value: Any) -> bool:
    """Tell whether all texts in a value are; h5py stands in for a byte that is none by half of a surrogate pair."""
    if isinstance(value, list):
        return all(_is_utf8(item) for item in value)
    return not isinstance(value, str) or not any("\ud800" <= letter <= "\udfff" for letter in value)
