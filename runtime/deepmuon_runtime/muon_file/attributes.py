"""What the attributes of a muon file must be."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any, NamedTuple

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.latents.philox import LARGEST_SEED
from deepmuon_runtime.latents.shard import Shard
from deepmuon_runtime.model.metadata import Model, are_one_rate, is_name
from deepmuon_runtime.muon_file.checksum import attributes_crc32, unlike
from deepmuon_runtime.muon_file.format import ATTRIBUTES_CHECKSUM, python_value
from deepmuon_runtime.muon_file.place_and_time import choice_defects
from deepmuon_runtime.version import VERSION

__all__ = [
    "ALWAYS",
    "LIVE_TIMES",
    "Description",
    "attribute_defects",
    "checksum_defects",
    "is_generated",
    "sound_attributes",
    "value_defects",
]

ROUNDING = 1e-9  # relative, of a live time


class _Rule(NamedTuple):
    is_good: Callable[[Any], bool]
    meaning: str


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_utc(value: Any) -> bool:
    try:
        time = datetime.fromisoformat(re.sub("Z$", "+00:00", value))  # Python 3.10 does not know the Z
    except (TypeError, ValueError):
        return False
    return time.utcoffset() == timedelta(0)


def _is_shard(value: Any) -> bool:
    try:
        return isinstance(value, str) and str(Shard.parse(value)) == value
    except RefusedError:
        return False


TEXT = _Rule(lambda x: isinstance(x, str) and x != "", "a text")
NAME = _Rule(lambda x: isinstance(x, str) and is_name(x), "a name")
TEXTS = _Rule(lambda x: isinstance(x, list) and all(isinstance(line, str) for line in x), "a list of texts")
WHOLE = _Rule(_is_whole, "a whole number from 0 on")
NOT_NEGATIVE = _Rule(lambda x: _is_number(x) and x >= 0, "a finite number from 0 on")
POSITIVE = _Rule(lambda x: _is_number(x) and x > 0, "a finite number above 0")
ZENITH = _Rule(lambda x: _is_number(x) and 0 <= x <= 90, "a number of degrees from 0 to 90")
SIZES = _Rule(
    lambda x: isinstance(x, list) and x != [] and all(map(POSITIVE.is_good, x)), "a list of finite numbers above 0"
)

ALWAYS = {
    "count": WHOLE,
    "depth_m": NOT_NEGATIVE,
    "medium": NAME,
    "created": _Rule(_is_utc, "a time in UTC, as in 2025-12-31T23:59:59+00:00"),
    "created_by": TEXT,
}
GENERATED = {
    "seed": _Rule(lambda x: _is_whole(x) and x <= LARGEST_SEED, "a whole number from 0 to 2^64 - 1"),
    "first": WHOLE,
    "total": WHOLE,
    "shard": _Rule(_is_shard, 'a shard, as in "1/1"'),
    "model_sha256": _Rule(lambda x: isinstance(x, str) and bool(re.fullmatch("[0-9a-f]{64}", x)), "64 hex digits"),
    "architecture": NAME,
    "device": _Rule(lambda x: isinstance(x, str) and x in ("cpu", "cuda"), '"cpu" or "cuda"'),
}
CONVERTED = {"source": TEXT, "provenance": TEXTS}
WHERE_KNOWN = {
    "smoothed": _Rule(lambda x: isinstance(x, bool), "true or false"),
    "command_line": TEXT,
    "rate_hz_per_m2": NOT_NEGATIVE,
    "rate_uncertainty_hz_per_m2": NOT_NEGATIVE,
    "variance_factor": POSITIVE,
    "live_time_s_m2": NOT_NEGATIVE,
    "live_time_s": POSITIVE,
    "area_m2": POSITIVE,
    "flux": NAME,
    "surface": _Rule(lambda x: _is_whole(x) and x <= 1, "0 (a horizontal plane) or 1 (a sphere)"),
    "energy_min_gev": NOT_NEGATIVE,
    "energy_max_gev": POSITIVE,
    "zenith_min_degrees": ZENITH,
    "zenith_max_degrees": ZENITH,
    "fraction_kept": _Rule(lambda x: _is_number(x) and 0 < x <= 1, "a number above 0 and at most 1"),
    "target": NAME,
    "target_size_m": SIZES,
    "target_rate_hz": NOT_NEGATIVE,
    "target_rate_uncertainty_hz": NOT_NEGATIVE,
    "target_live_time_s": NOT_NEGATIVE,
}
LIVE_TIMES = {"live_time_s_m2": "rate_hz_per_m2", "target_live_time_s": "target_rate_hz"}
"""What the number of muons in a file makes of each rate above 0: count / rate."""

RULES = {**ALWAYS, **GENERATED, **CONVERTED, **WHERE_KNOWN}


def is_generated(attributes: Mapping[str, Any]) -> bool:
    """Tell whether a model made the muons, and not a conversion or transport: one attribute of a model says so."""
    return not attributes.keys().isdisjoint(GENERATED)


def sound_attributes(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes of the format whose values are what they can be."""
    return {name: value for name, value in attributes.items() if name in RULES and RULES[name].is_good(value)}


def checksum_defects(attributes: Mapping[str, Any], version: int) -> Iterator[str]:
    """Yield what the checksum says against the attributes of `/muons`.

    Parameters
    ----------
    attributes
        All of them, as `format.stated` gives them, their checksum among them.
    version
        The format version of the file; version 1 had no checksum of attributes.
    """
    others = {name: value for name, value in attributes.items() if name != ATTRIBUTES_CHECKSUM}
    expected = attributes.get(ATTRIBUTES_CHECKSUM)
    if expected is None:
        if version > 1:
            yield f"the attribute {ATTRIBUTES_CHECKSUM} is missing"
        return
    try:
        found = attributes_crc32(others)
    except ValueError as error:
        yield str(error)
        return
    if not isinstance(expected, int):
        yield f"the attribute {ATTRIBUTES_CHECKSUM} is {_shown(expected)}, and should be a number, their CRC-32"
    elif found != expected:
        yield f"what the attributes say {unlike(found, expected)}"


def value_defects(attributes: Mapping[str, Any]) -> Iterator[str]:
    """Yield which of the format's attributes have values that they can't have."""
    sound = sound_attributes(attributes)
    for name, value in attributes.items():
        if name in RULES and name not in sound:
            yield f"the attribute {name} is {_shown(value)}, and should be {RULES[name].meaning}"


def attribute_defects(attributes: Mapping[str, Any], model: Model | None) -> Iterator[str]:
    """Yield what is wrong with the attributes of `/muons`, a line each.

    Parameters
    ----------
    attributes
        All of them, as `read_attributes` gives them.
    model
        The released model that made the muons, if it was one.
    """
    required = {**ALWAYS, **(GENERATED if is_generated(attributes) else CONVERTED)}
    yield from (f"the attribute {name} is missing" for name in required if name not in attributes)
    yield from value_defects(attributes)
    sound = sound_attributes(attributes)
    yield from _shard_defects(sound)
    yield from _live_time_defects(sound)
    yield from choice_defects(sound)
    if model is not None:
        yield from _model_defects(sound, model)


def _shard_defects(sound: Mapping[str, Any]) -> Iterator[str]:
    if not {"shard", "total", "first", "count"} <= sound.keys():
        return
    expected = Shard.parse(sound["shard"]).numbers(sound["total"])
    first, end = sound["first"], sound["first"] + sound["count"]
    if (first, end) != (expected.start, expected.stop):
        yield (
            f"the muons are numbers {first} to {end} (without the end) of {sound['total']} by first and count, and "
            f"{expected.start} to {expected.stop} by shard {sound['shard']}"
        )


def _live_time_defects(sound: Mapping[str, Any]) -> Iterator[str]:
    if "live_time_s" in sound and sound.keys().isdisjoint({"area_m2", "target"}):
        yield "live_time_s goes with area_m2 or target, and none of them is there"
    if "area_m2" in sound and "live_time_s" not in sound:
        yield "area_m2 goes with live_time_s, which is not there"
    for live_time, rate in LIVE_TIMES.items():
        if (sound.get(rate, 0) > 0) != (live_time in sound):
            yield f"{rate} and {live_time} go together, and only one is there"
        elif {rate, live_time, "count"} <= sound.keys():
            expected, found = sound["count"] / sound[rate], sound[live_time]
            if not math.isclose(found, expected, rel_tol=ROUNDING):
                yield f"the attribute {live_time} is {found!r}, and count / {rate} is {expected!r}"
        elif sound.get(rate) == 0 and sound.get("count"):
            yield f"the attribute {rate} is 0, and count is {sound['count']}"


def _model_defects(sound: Mapping[str, Any], model: Model) -> Iterator[str]:
    if "depth_m" in sound and model.is_family and not model.has_depth(sound["depth_m"]):
        yield f"the attribute depth_m is {sound['depth_m']:g}, and its model {model.name} has {model.depths}"
        return
    flux = ["flux"] if "flux" in sound and "flux" in model.metadata else []
    for name in ["depth_m", "medium", "architecture", *flux]:
        expected, found = getattr(model, name), sound.get(name)
        if found != expected:
            yield f"the attribute {name} is {_shown(found)}, and that of its model {model.name} is {_shown(expected)}"
    yield from _rate_defects(sound, model)


def _rate_defects(sound: Mapping[str, Any], model: Model) -> Iterator[str]:
    """Yield how the rates are not those of the model."""
    rate, kept = model.rate_hz_per_m2, sound.get("fraction_kept", 1.0)
    if "target" in sound:
        found = sound.get("target_rate_hz")
        expected = (rate or 0.0) * math.prod(sound.get("target_size_m", [])) * kept
        if rate and sound["target"] == "plane" and not (found and are_one_rate(found, expected)):
            yield (
                f"the attribute target_rate_hz is {_shown(found)}, and the rate of its model {model.name} makes "
                f"{expected:.5g}"
            )
        return
    for name in ("rate_hz_per_m2", "rate_uncertainty_hz_per_m2"):
        expected, found = getattr(model, name), sound.get(name)
        if "fraction_kept" in sound:
            if name == "rate_hz_per_m2" and expected and not (found and are_one_rate(found, expected * kept)):
                yield (
                    f"the attribute {name} is {_shown(found)}, and that of its model {model.name}, "
                    f"{_shown(expected)}, makes {expected * kept:.5g} with fraction_kept"
                )
        elif found != expected and not (model.is_family and found and expected and are_one_rate(found, expected)):
            yield f"the attribute {name} is {_shown(found)}, and that of its model {model.name} is {_shown(expected)}"


def _shown(value: object) -> str:
    text = ascii(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


SOURCE_DATE_EPOCH = "SOURCE_DATE_EPOCH"
"""Environment variable that states the time of `created`, so that a repeated run gives the same bytes
(https://reproducible-builds.org/specs/source-date-epoch/)."""


class Description:
    """What a file that is being written says of its muons.

    Parameters
    ----------
    path
        The file, for errors.
    attributes
        What was given: see `deepmuon_runtime.muon_file.writer.MuonWriter`.

    Raises
    ------
    RefusedError
        If an attribute is missing or can't be what it is, or SOURCE_DATE_EPOCH is no time.
    """

    def __init__(self, path: str | Path, attributes: Mapping[str, object]) -> None:
        missing = [name for name in ("depth_m", "medium") if name not in attributes]
        if missing:
            raise RefusedError(f"a muon file must say its {' and '.join(missing)}: add it to the attributes")
        self._created = _stated_time()
        self._attributes = {name: _storable(value) for name, value in attributes.items()}
        for defect in _defects(self._attributes):
            raise RefusedError(f"{path} was not written: {defect}")

    def of(self, count: int) -> dict[str, Any]:
        """Return all attributes of a file of so many muons that is complete now."""
        attributes = {"created_by": f"deepmuon-runtime {VERSION}", **self._attributes}
        attributes["count"] = count
        attributes["created"] = (self._created or datetime.now(timezone.utc)).isoformat(timespec="seconds")
        for live_time, rate in LIVE_TIMES.items():
            if attributes.get(rate, 0) > 0:
                attributes[live_time] = count / float(attributes[rate])
        return attributes


def _stated_time() -> datetime | None:
    """Return the time that the environment states for all that is made, if it does.

    Raises
    ------
    RefusedError
        If it is none.
    """
    stated = os.environ.get(SOURCE_DATE_EPOCH)
    if stated is None:
        return None
    try:
        return datetime.fromtimestamp(int(stated), timezone.utc)
    except (ValueError, OverflowError, OSError) as error:
        raise RefusedError(
            f"{SOURCE_DATE_EPOCH} is {stated!r}, and should be whole seconds since 1970 (unset it for the present time)"
        ) from error


def _storable(value: Any) -> Any:
    """Return an attribute with what HDF5 can't hold in a text escaped: the byte 0, and what is no UTF-8."""
    if isinstance(value, (list, tuple)):
        return [_storable(item) for item in value]
    if isinstance(value, str):
        return value.replace("\0", r"\x00").encode("utf-8", "backslashreplace").decode()
    return value


def _defects(attributes: Mapping[str, Any]) -> Iterator[str]:
    """Yield what keeps attributes from being written: no reader would take them."""
    attributes = {name: python_value(value) for name, value in attributes.items()}
    try:
        attributes_crc32(attributes)
    except ValueError as error:
        yield str(error)
    yield from value_defects(attributes)
