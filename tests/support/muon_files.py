"""Muon files by hand: signed again after a change, and of version 1."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zlib import crc32

import h5py
import numpy as np

from deepmuon_runtime import Muons

__all__ = ["sign", "sign_attributes", "write_version_1"]


def sign(muons: h5py.Group) -> None:
    """Give `/muons` and its columns the checksums of what they hold now."""
    for column in muons.values():
        if isinstance(column, h5py.Dataset):
            column.attrs["crc32"] = 0 if column.is_virtual else crc32(column[:].tobytes())
    sign_attributes(muons)


def sign_attributes(muons: h5py.Group) -> None:
    """Give `/muons` the checksum of its attributes, by what docs/hdf5_format.md says of it and nothing else."""
    text = b""
    for name in sorted(muons.attrs, key=str.encode):
        if name != "attributes_crc32":
            text += name.encode() + b"\0" + b"".join(item + b"\0" for item in items(muons.attrs[name]))
    muons.attrs["attributes_crc32"] = np.uint32(crc32(text))


def items(value: Any) -> list[bytes]:
    """Return a value as the texts that the checksum is of."""
    if isinstance(value, np.ndarray):
        return [b"l" + str(len(value)).encode(), *(text for item in value for text in items(item))]
    if isinstance(value, (str, bytes)):
        return [b"s" + (value.encode() if isinstance(value, str) else value)]
    if value.dtype.kind == "b":
        return [b"b1" if value else b"b0"]
    if value.dtype.kind in "iu":
        return [b"i" + str(int(value)).encode()]
    return [b"f" + struct.pack(">d", value).hex().encode()]


def write_version_1(path: Path, muons: Muons, attributes: Mapping[str, Any]) -> None:
    """Write a file as release 0.1.0 did."""
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "deepmuon-muons", 1
        group = file.create_group("muons")
        for name in ("kinetic_energy", "u", "v", "w", "pdg_id"):
            values = getattr(muons, name)
            column = group.create_dataset(name, data=values, chunks=(1024,), maxshape=(None,))
            column.attrs["units"] = "GeV" if name == "kinetic_energy" else "1"
            column.attrs["crc32"] = np.uint32(crc32(values.tobytes()))
        for name, value in attributes.items():
            group.attrs[name] = value
