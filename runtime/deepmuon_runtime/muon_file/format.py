"""The format of a muon file, version 1.

::

    /                       format="deepmuon-muons", format_version=1
    /muons/kinetic_energy   float32  units="GeV"
    /muons/u, v, w          float32  units="1"
    /muons/pdg_id           int8     13 = mu-, -13 = mu+
    /muons attributes       count, depth_m, medium, created, created_by, and what else is known

Each column has the attribute crc32, the CRC-32 of its bytes one after the other.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from deepmuon_runtime.errors import RefusedError

__all__ = ["BYTES_PER_MUON", "CHECKSUM", "COLUMNS", "FORMAT", "FORMAT_VERSION", "check_format", "python_value"]

FORMAT = "deepmuon-muons"
FORMAT_VERSION = 1

CHECKSUM = "crc32"
"""The attribute of a column with the CRC-32 of its bytes."""

COLUMNS: dict[str, tuple[np.dtype[Any], str]] = {
    "kinetic_energy": (np.dtype("<f4"), "GeV"),
    "u": (np.dtype("<f4"), "1"),
    "v": (np.dtype("<f4"), "1"),
    "w": (np.dtype("<f4"), "1"),
    "pdg_id": (np.dtype("i1"), "1"),
}
"""Type and unit of each dataset of `/muons`."""

BYTES_PER_MUON = sum(dtype.itemsize for dtype, _ in COLUMNS.values())


def check_format(file: h5py.File, path: str | Path) -> None:
    """Raise RefusedError unless a file says that it is a muon file of this version."""
    form, form_version = file.attrs.get("format"), file.attrs.get("format_version")
    if form != FORMAT:
        raise RefusedError(f"{path} is no muon file: it lacks the attribute format={FORMAT!r}")
    if form_version != FORMAT_VERSION:
        raise RefusedError(f"{path} has format version {form_version}, and this release reads version {FORMAT_VERSION}")


def python_value(value: Any) -> Any:
    """Return an attribute as Python's str, int, float, bool, or a list of them."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.item() if isinstance(value, np.generic) else value
