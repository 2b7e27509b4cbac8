"""Settings of a run in a TOML file, read into dataclasses and written back."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from deepmuon_runtime.errors import RefusedError

__all__ = ["read_table", "settings_from", "to_toml"]

T = TypeVar("T")

_MEANINGS = {bool: "true or false", int: "a whole number", float: "a finite number", str: 'a text in "quotes"'}


def read_table(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    RefusedError
        If it can't be read, or is no TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RefusedError(f"{path} can't be read: {error.strerror}") from error
    except ValueError as error:  # no TOML, or no UTF-8
        raise RefusedError(f"{path} is no TOML file: {error}") from error


def settings_from(defaults: T, table: dict[str, Any], name: str) -> T:
    """Return settings with the values of a table, and those in their fields with those of the tables inside.

    Parameters
    ----------
    defaults
        Instance of a dataclass whose fields are bool, int, float, str, one of these or None, a literal, such
        dataclasses, or a mapping of names to them, of which each counts as a field.
    table
        Values by the names of the fields; what is left out stays. A whole number is written as an integer, or as
        in 4e6.
    name
        Of the file (and its table), for error messages.

    Raises
    ------
    RefusedError
        If a key is unknown, or a value can't be; also by what the ``__post_init__`` of the dataclass refuses.
    """
    hints, known = get_type_hints(type(defaults)), _by_key(defaults)
    for key in table:
        if key not in known:
            (nearest,) = get_close_matches(key, known, n=1, cutoff=0)
            raise RefusedError(f"{name}: unknown key {key!r}; the nearest known one is {nearest!r}")
    values: dict[str, Any] = {}
    for key, value in table.items():
        field, default = known[key]
        kind = hints[field] if field == key else type(default)
        found = _value(kind, value, f"{name}: {key}", default)
        values[field] = found if field == key else {**values.get(field, getattr(defaults, field)), key: found}
    try:
        return replace(defaults, **values)  # type: ignore[type-var]
    except RefusedError as error:
        raise RefusedError(f"{name}: {error}") from error


def _by_key(settings: Any) -> dict[str, tuple[str, Any]]:
    """Return the keys that settings have in a file, each with its field and value: a mapping's names are keys."""
    known: dict[str, tuple[str, Any]] = {}
    for field in fields(settings):
        value = getattr(settings, field.name)
        inner = value if isinstance(value, Mapping) else {field.name: value}
        known |= {key: (field.name, one) for key, one in inner.items()}
    return known


def _value(kind: Any, value: Any, name: str, default: Any) -> Any:
    """Return a value as its field's type."""
    if get_origin(kind) is UnionType:  # a type or None, which TOML has not: the key is left out
        kind = get_args(kind)[0]
    if is_dataclass(kind):
        if not isinstance(value, dict):
            raise RefusedError(f"{name} is {value!r}, and should be a table")
        return settings_from(default, value, name)
    if get_origin(kind) is Literal:
        if value not in get_args(kind):
            raise RefusedError(f"{name} is {value!r}, and should be {' or '.join(map(repr, get_args(kind)))}")
        return value
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    if kind is float and is_number:
        return float(value)
    if kind is int and is_number and value == int(value):
        return int(value)
    if kind in (bool, str) and type(value) is kind:
        return value
    raise RefusedError(f"{name} is {value!r}, and should be {_MEANINGS[kind]}")


def to_toml(settings: Any) -> str:
    """Write a dataclass of settings as TOML, every value stated but None."""
    return "\n".join(_lines(settings, "")) + "\n"


def _lines(settings: Any, table: str) -> list[str]:
    values = {key: value for key, (_, value) in _by_key(settings).items()}
    inner = {key: value for key, value in values.items() if is_dataclass(value)}
    lines = [f"{key} = {_scalar(value)}" for key, value in values.items() if key not in inner and value is not None]
    for key, value in inner.items():
        name = f"{table}.{key}" if table else key
        scalars = [field for field in fields(value) if not is_dataclass(getattr(value, field.name))]
        lines += [*(["", f"[{name}]"] if scalars else []), *_lines(value, name)]
    return lines


def _scalar(value: bool | int | float | str) -> str:
    """Write a value: as in JSON, but for the one character that TOML wants to be escaped and JSON does not."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
