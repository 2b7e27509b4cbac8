"""Trees of dataclasses as JSON, and back."""

from __future__ import annotations

import json
from dataclasses import asdict, is_dataclass
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

__all__ = ["from_json", "to_json"]

T = TypeVar("T")


def to_json(record: Any) -> str:
    """Write a dataclass instance, whose fields are numbers, strings, None, tuples, dicts or dataclasses.

    Raises
    ------
    ValueError
        If a number is NaN or infinite: JSON has neither.
    """
    return json.dumps(asdict(record), allow_nan=False, indent=1)


def from_json(kind: type[T], text: str) -> T:
    """Read what `to_json` wrote of an instance of dataclass `kind`."""
    record: T = _build(kind, json.loads(text))
    return record


def _build(kind: Any, data: Any) -> Any:
    """Make data from JSON into what a type annotation says."""
    if is_dataclass(kind):
        kinds = get_type_hints(kind)
        return kind(**{name: _build(kinds[name], value) for name, value in data.items()})  # type: ignore[operator]
    arguments = get_args(kind)
    if get_origin(kind) is tuple:
        return tuple(_build(arguments[0], value) for value in data)
    if get_origin(kind) is dict:
        return {name: _build(arguments[1], value) for name, value in data.items()}
    if get_origin(kind) is UnionType:
        return None if data is None else _build(arguments[0], data)
    return data
