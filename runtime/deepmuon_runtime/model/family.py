"""A family of models: one file for any depth, which four bytes of it choose.

The depth and the surface are scalar initializers. Source of the field numbers:
https://github.com/onnx/onnx/blob/main/onnx/onnx.proto
"""

from __future__ import annotations

import struct

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import METADATA_PREFIX
from deepmuon_runtime.model.protobuf import field, fields, parts

__all__ = ["at_depth"]

_GRAPH, _METADATA, _INITIALIZER = 7, 14, 5
_NAME, _RAW = 8, 9
_KEY, _VALUE = 1, 2


def at_depth(contents: bytes, depth_m: float, surface: int = 0) -> bytes:
    """Return a family's file with another depth, and a surface: 0 a horizontal plane, 1 a sphere.

    Raises
    ------
    RefusedError
        If the file is no family, or the depth out of its range.
    ValueError
        If it is no message of Protocol Buffers.
    """
    message = memoryview(contents)
    entries = [_texts(value) for number, value in fields(message) if number == _METADATA]
    known = {entry.get(_KEY, ""): entry.get(_VALUE, "") for entry in entries}
    low, high = (known.get(f"{METADATA_PREFIX}depth_{end}_m") for end in ("min", "max"))
    if low is None or high is None:
        raise RefusedError(f"the model is for {known.get(METADATA_PREFIX + 'depth_m')} m alone, and no family")
    if not float(low) <= depth_m <= float(high):
        raise RefusedError(f"{depth_m:g} m is not in the range of the family, {low} to {high} m")
    raw = {b"depth_m": struct.pack("<f", depth_m), b"surface": struct.pack("<i", surface)}
    said = {
        f"{METADATA_PREFIX}depth_m": np.format_float_positional(np.float32(depth_m), trim="-"),
        f"{METADATA_PREFIX}surface": str(surface),
    }
    changed = b""
    for number, value, whole in parts(message):
        if number == _GRAPH and isinstance(value, memoryview):
            changed += field(number, _graph(value, raw))
        elif number == _METADATA and (key := _texts(value).get(_KEY)) in said:
            changed += field(number, field(_KEY, key.encode()) + field(_VALUE, said[key].encode()))
        else:
            changed += whole
    return changed


def _texts(entry: int | memoryview) -> dict[int, str]:
    assert isinstance(entry, memoryview)
    return {number: str(value, "utf-8") for number, value in fields(entry) if isinstance(value, memoryview)}


def _graph(graph: memoryview, raw: dict[bytes, bytes]) -> bytes:
    return b"".join(
        field(number, _tensor(value, raw)) if number == _INITIALIZER and isinstance(value, memoryview) else bytes(whole)
        for number, value, whole in parts(graph)
    )


def _tensor(tensor: memoryview, raw: dict[bytes, bytes]) -> bytes:
    name = next((bytes(value) for number, value in fields(tensor) if number == _NAME), b"")
    return b"".join(
        field(_RAW, raw[name]) if number == _RAW and name in raw else bytes(whole) for number, _, whole in parts(tensor)
    )
