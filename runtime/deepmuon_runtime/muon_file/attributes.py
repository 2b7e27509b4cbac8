"""What the attributes of a muon file must be."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.latents.philox import LARGEST_SEED
from deepmuon_runtime.latents.shard import Shard
from deepmuon_runtime.model.metadata import Model, is_name

__all__ = ["attribute_defects", "is_generated", "sound_attributes"]

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
    "command_line": TEXT,
}
CONVERTED = {"source": TEXT, "provenance": TEXTS}
WHERE_KNOWN = {
    "smoothed": _Rule(lambda x: isinstance(x, bool), "true or false"),
    "rate_hz_per_m2": POSITIVE,
    "rate_uncertainty_hz_per_m2": NOT_NEGATIVE,
    "variance_factor": POSITIVE,
    "flux": NAME,
    "live_time_s_m2": NOT_NEGATIVE,
    "live_time_s": POSITIVE,
    "area_m2": POSITIVE,
}
RULES = {**ALWAYS, **GENERATED, **CONVERTED, **WHERE_KNOWN}


def is_generated(attributes: Mapping[str, Any]) -> bool:
    """Tell whether a model made the muons, and not a conversion or transport: one attribute of a model says so."""
    return not attributes.keys().isdisjoint(GENERATED)


def sound_attributes(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes of the format whose values are what they can be."""
    return {name: value for name, value in attributes.items() if name in RULES and RULES[name].is_good(value)}


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
    sound = sound_attributes(attributes)
    for name, value in attributes.items():
        if name in RULES and name not in sound:
            yield f"the attribute {name} is {_shown(value)}, and should be {RULES[name].meaning}"
    yield from _shard_defects(sound)
    yield from _live_time_defects(sound)
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
    if ("live_time_s" in sound) != ("area_m2" in sound):
        yield "live_time_s and area_m2 go together, and only one is there"
    if ("rate_hz_per_m2" in sound) != ("live_time_s_m2" in sound):
        yield "rate_hz_per_m2 and live_time_s_m2 go together, and only one is there"
    elif {"rate_hz_per_m2", "live_time_s_m2", "count"} <= sound.keys():
        expected, found = sound["count"] / sound["rate_hz_per_m2"], sound["live_time_s_m2"]
        if not math.isclose(found, expected, rel_tol=ROUNDING):
            yield f"the attribute live_time_s_m2 is {found!r}, and count / rate_hz_per_m2 is {expected!r}"


def _model_defects(sound: Mapping[str, Any], model: Model) -> Iterator[str]:
    for name in ("depth_m", "medium", "architecture", "rate_hz_per_m2", "rate_uncertainty_hz_per_m2"):
        expected, found = getattr(model, name), sound.get(name)
        if found != expected:
            yield f"the attribute {name} is {_shown(found)}, and that of its model {model.name} is {_shown(expected)}"


def _shown(value: object) -> str:
    text = ascii(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
