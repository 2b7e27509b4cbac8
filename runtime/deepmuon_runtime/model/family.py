"""Any depth from one file: a family is a model with one number in it, the depth, which is written before it is loaded.

The number is the initializer `depth_m`. What follows from it alone, the tables of that depth and the rate, the engine
calculates while it loads the file: muons take no longer than those of a model of one depth. A second number, `surface`,
chooses between the flux through a horizontal plane and that through a sphere.

The file is changed as the Protocol Buffers message that it is, without the onnx package. Source of the field numbers:
https://github.com/onnx/onnx/blob/main/onnx/onnx.proto
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Mapping
from numbers import Real
from typing import NamedTuple

import numpy as np

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import HORIZONTAL_PLANE, METADATA_PREFIX, SPHERE, Model
from deepmuon_runtime.model.protobuf import field, fields, parts, with_changed

__all__ = ["at_depth", "depth_text", "read_model", "with_metadata"]

GRAPH_OF_MODEL, METADATA_OF_MODEL = 7, 14
INITIALIZER_OF_GRAPH = 5
KEY, VALUE = 1, 2
DIMENSION, TYPE, NAME, RAW_DATA = 1, 2, 8, 9
EMPTY = memoryview(b"")


class _Scalar(NamedTuple):
    """How a number of the contract is stored: ONNX's code of its type, its format for `struct`, and the other field."""

    type: int
    format: str
    data: int


SCALARS = {"depth_m": _Scalar(1, "<f", 4), "surface": _Scalar(6, "<i", 5)}
"""The initializers that are written, float32 and int32: the number is in `raw_data`, or in the other field."""


def read_model(contents: bytes, name: str) -> Model:
    """Return what a model file says of itself.

    Parameters
    ----------
    contents
        An ONNX file.
    name
        What to call it in an error.

    Raises
    ------
    RefusedError
        If it is no message of Protocol Buffers, a text in its metadata is none, or a key of the contract is missing or
        has a value that it can't have.
    """
    try:
        entries = [dict(fields(entry)) for entry in _messages(memoryview(contents), METADATA_OF_MODEL)]
        texts = {_text(entry.get(KEY)): _text(entry.get(VALUE)) for entry in entries}
    except UnicodeDecodeError as error:
        raise RefusedError(f"{name} breaks the contract: its metadata is no text in UTF-8") from error
    except ValueError as error:
        raise RefusedError(f"{name} is no ONNX model: {error}") from error
    metadata = {
        key.removeprefix(METADATA_PREFIX): text for key, text in texts.items() if key.startswith(METADATA_PREFIX)
    }
    return Model.from_metadata(metadata, name, hashlib.sha256(contents).hexdigest(), len(contents))


def at_depth(contents: bytes, depth_m: float, surface: int = HORIZONTAL_PLANE, name: str = "the model") -> bytes:
    """Return a family with another depth in it, which any engine then loads as a model of that depth.

    Four bytes of an initializer change, another four for the surface, and the texts of the metadata that say the same.

    Parameters
    ----------
    contents
        An ONNX file, a family.
    depth_m
        Metres of its medium, within its range. Depths are float32: what is nearest to it is taken.
    surface
        What the muons cross: 0 is a horizontal plane, 1 a sphere.
    name
        What to call the file in an error.

    Raises
    ------
    RefusedError
        If the file is no family or lacks the depth or surface, or if its metadata and its initializers disagree.
    """
    model = read_model(contents, name)
    if not model.is_family:
        raise RefusedError(f"{name} is no family: all its muons are of {model.depth_m:g} m; give no depth with it")
    if not isinstance(depth_m, Real) or isinstance(depth_m, bool):
        raise RefusedError(f"the depth {depth_m!r} is no number: give metres, such as depth=10")
    if not model.has_depth(float(depth_m)):
        raise RefusedError(f"no depth of {depth_m:g} m in {name}: there are those from {model.depths} m")
    if surface not in (HORIZONTAL_PLANE, SPHERE):
        raise RefusedError(f"there is no surface {surface!r}: 0 is a horizontal plane, 1 a sphere")
    try:
        found = _scalars(contents, name)
    except ValueError as error:
        raise RefusedError(f"{name} is no ONNX model: {error}") from error
    if "surface" not in found and surface != HORIZONTAL_PLANE:
        raise RefusedError(f"{name} has no tables of a sphere's flux: its muons cross a horizontal plane")
    _check_default(found, model)
    numbers: dict[str, float] = {"depth_m": float(depth_m), "surface": surface}

    def with_number(tensor: memoryview) -> bytes:
        key = _name(tensor)
        if key not in found:
            return bytes(tensor)
        stored, scalar = (RAW_DATA, SCALARS[key].data), SCALARS[key]
        kept = b"".join(whole for number, _, whole in parts(tensor) if number not in stored)
        return kept + field(RAW_DATA, struct.pack(scalar.format, numbers[key]))

    def with_numbers(graph: memoryview) -> bytes:
        return with_changed(graph, INITIALIZER_OF_GRAPH, with_number)

    placed = with_changed(memoryview(contents), GRAPH_OF_MODEL, with_numbers)
    said = {"depth_m": depth_text(depth_m), "surface": str(surface) if "surface" in found else None}
    return with_metadata(placed, {key: text for key, text in said.items() if text is not None})


def depth_text(depth_m: float) -> str:
    """Return the shortest text of a depth, which is float32: 13.7, or 10.

    Examples
    --------
    >>> depth_text(13.7), depth_text(10.0)
    ('13.7', '10')
    """
    return np.format_float_positional(np.float32(depth_m + 0.0), trim="-")  # -0 + 0 is 0


def with_metadata(contents: bytes, changes: Mapping[str, str | None]) -> bytes:
    """Return a model file whose metadata has other texts.

    Parameters
    ----------
    contents
        An ONNX file.
    changes
        Texts by their keys of the contract, without the prefix; a None takes the key out.
    """
    keys = {METADATA_PREFIX + key: text for key, text in changes.items()}
    kept = [
        bytes(whole)
        for number, value, whole in parts(memoryview(contents))
        if not (number == METADATA_OF_MODEL and isinstance(value, memoryview) and _entry_key(value) in keys)
    ]
    added = [
        field(METADATA_OF_MODEL, field(KEY, key.encode()) + field(VALUE, text.encode()))
        for key, text in keys.items()
        if text is not None
    ]
    return b"".join(kept + added)


def _scalars(contents: bytes, name: str) -> dict[str, float]:
    """Return the numbers that may be written, by the names of their initializers, as they are in the file."""
    found: dict[str, float] = {}
    for graph in _messages(memoryview(contents), GRAPH_OF_MODEL):
        for tensor in _messages(graph, INITIALIZER_OF_GRAPH):
            key = _name(tensor)
            if key not in SCALARS:
                continue
            if key in found:
                raise RefusedError(f"{name} breaks the contract: it has two initializers {key}")
            found[key] = _number(tensor, SCALARS[key], f"{name} breaks the contract: its initializer {key}")
    if "depth_m" not in found:
        raise RefusedError(f"{name} breaks the contract: it says that it is a family, and has no initializer depth_m")
    return found


def _number(tensor: memoryview, scalar: _Scalar, what: str) -> float:
    """Return the number in a tensor, or refuse one that is no scalar of the right type."""
    stored = list(fields(tensor))
    kinds = [value for number, value in stored if number == TYPE]
    dimensions = [value for number, value in stored if number == DIMENSION and value != EMPTY]
    if kinds != [scalar.type] or dimensions:
        kind = "float32" if scalar.format == "<f" else "int32"
        raise RefusedError(f"{what} should be a scalar of type {kind}")
    data = [value for number, value in stored if number in (RAW_DATA, scalar.data) and value != EMPTY]
    (value,) = data if len(data) == 1 else [None]
    if isinstance(value, memoryview) and len(value) == 4:
        return float(struct.unpack(scalar.format, value)[0])
    if scalar.format == "<i" and isinstance(value, int):
        return value
    if scalar.format == "<i" and isinstance(value, memoryview) and len(value) == 1:  # a packed number below 128
        return value[0]
    raise RefusedError(f"{what} should hold one number")


def _check_default(found: Mapping[str, float], model: Model) -> None:
    """Refuse a family that is loaded with other numbers than its metadata says."""
    said = {"depth_m": float(np.float32(model.depth_m)), "surface": model.surface}
    for key, number in found.items():
        if number != said[key]:
            raise RefusedError(
                f"{model.name} breaks the contract: its initializer {key} is {number:g}, and its metadata says "
                f"{said[key]:g}"
            )


def _messages(message: memoryview, number: int) -> Iterator[memoryview]:
    """Yield the messages in the fields of a number."""
    return (value for found, value in fields(message) if found == number and isinstance(value, memoryview))


def _name(tensor: memoryview) -> str:
    return "".join(str(value, "utf-8", "replace") for value in _messages(tensor, NAME))


def _entry_key(entry: memoryview) -> str:
    return "".join(str(key, "utf-8", "replace") for key in _messages(entry, KEY))


def _text(value: int | memoryview | None) -> str:
    return str(value, "utf-8") if isinstance(value, memoryview) else ""
