"""What a file says of its muons, as lines of text: name = value, the value in JSON.

The numbers that are known only when all muons are written are as wide as any: a header is written first with zeros in
their places, and once more at the end.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import is_name
from deepmuon_runtime.muon_file.attributes import ALWAYS, LIVE_TIMES, checksum_defects, value_defects
from deepmuon_runtime.muon_file.checksum import attributes_crc32
from deepmuon_runtime.muon_file.format import ATTRIBUTES_CHECKSUM, CHECKSUM, FORMAT, FORMAT_VERSION, python_value

__all__ = ["COLUMN_NAMES", "FIRST_NOTE", "notes", "said", "understood"]

COLUMN_NAMES = "columns"
"""The note that names the columns, where nothing else of the format does."""

FIRST_NOTE = f'format = "{FORMAT}"'
"""The first of all lines, by which a file of ours is known."""

_NOT_OF_MUONS = ("format", "format_version", COLUMN_NAMES, ATTRIBUTES_CHECKSUM, CHECKSUM)
_KNOWN_AT_THE_END = ("count", *LIVE_TIMES, ATTRIBUTES_CHECKSUM, CHECKSUM)
_WIDTH = 24  # of any float64 in JSON, and of any 64-bit number


def said(attributes: Mapping[str, Any], **more: object) -> dict[str, Any]:
    """Return attributes, and more that only this format says, as JSON can have them, with the checksum of the former.

    Parameters
    ----------
    attributes
        Those of a muon file.
    more
        For instance `crc32`, of what follows the header.

    Raises
    ------
    RefusedError
        If an attribute has a name by which it would not be read back.
    """
    for name in attributes:
        if not is_name(name) or " = " in name or name in _NOT_OF_MUONS:
            raise RefusedError(f"the attribute {ascii(name)[:80]} has a name that no other format than HDF5 can hold")
    plain = {name: _decoded(python_value(value)) for name, value in attributes.items()}
    checked = {ATTRIBUTES_CHECKSUM: attributes_crc32(plain)}
    return {"format": FORMAT, "format_version": FORMAT_VERSION, **plain, **checked, **more}


def _decoded(value: Any) -> Any:
    """Return a value with its texts as such, which HDF5 may give as bytes."""
    if isinstance(value, list):
        return [_decoded(item) for item in value]
    return value.decode("utf-8", "backslashreplace") if isinstance(value, bytes) else value


def notes(statements: Mapping[str, Any]) -> list[str]:
    """Return what `said` gives as lines."""
    return [f"{name} = {_fixed(name, json.dumps(value))}" for name, value in statements.items()]


def _fixed(name: str, value: str) -> str:
    return f"{value:>{_WIDTH}}" if name in _KNOWN_AT_THE_END else value


def understood(lines: Iterable[str] | Mapping[str, Any], path: object) -> tuple[dict[str, Any], dict[str, Any]]:
    """Take apart what a file says: lines, or the names and values that were in them.

    Returns
    -------
    The attributes of its muons, and what else it says.

    Raises
    ------
    RefusedError
        If it is no file of muons, of a later version or damaged: the attributes are not what was written.
    """
    stated = dict(lines) if isinstance(lines, Mapping) else _values(lines, path)
    if stated.pop("format", None) != FORMAT:
        raise RefusedError(
            f"{path} was not written by DeepMuon: it does not say {FIRST_NOTE} (deepmuon-train convert reads others)"
        )
    version = stated.pop("format_version", None)
    if version != FORMAT_VERSION:
        raise RefusedError(f"{path} has format version {version}, and this release reads version {FORMAT_VERSION}")
    more = {name: stated.pop(name) for name in (CHECKSUM, COLUMN_NAMES) if name in stated}
    for defect in checksum_defects(stated, FORMAT_VERSION):
        raise RefusedError(f"{path} is damaged: {defect}")
    del stated[ATTRIBUTES_CHECKSUM]
    for name in ALWAYS:
        if name not in stated:
            raise RefusedError(f"{path} lacks the attribute {name}")
    for defect in value_defects(stated):
        raise RefusedError(f"{path}: {defect}")
    return stated, more


def _values(lines: Iterable[str], path: object) -> dict[str, Any]:
    values = {}
    for line in lines:
        name, equals, value = line.partition(" = ")
        if not equals:
            continue  # a remark of somebody else
        try:
            values[name] = json.loads(value)
        except (ValueError, RecursionError) as error:
            raise RefusedError(f"{path}: {name[:60]} is followed by what is no JSON") from error
    return values
