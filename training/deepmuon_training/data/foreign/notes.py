"""What `deepmuon-convert` says of muons in comments, believed where it can be, and where all of its muons are there."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.attributes import sound_attributes
from deepmuon_runtime.targets.plane import Plane
from deepmuon_training.data.foreign.table import Table

__all__ = ["EXPOSURE", "check_stated", "known_of", "of_all_rows"]

RATE = ("rate_hz_per_m2", "rate_uncertainty_hz_per_m2")

EXPOSURE = ("live_time_s", "area_m2")
"""Of muons that were made for a live time on an area."""

TARGET_RATE = ("target_rate_hz", "target_rate_uncertainty_hz")
"""How many muons a second hit a target, and the uncertainty."""

OPTIONS = {"depth": "depth_m", "medium": "medium", "rate": RATE[0], "rate_uncertainty": RATE[1]}
"""Which attribute each option states."""


def known_of(table: Table) -> dict[str, Any]:
    """Return the attributes of a muon file that a table has in its comments.

    Raises
    ------
    RefusedError
        If one of the format has a value that it can't have, or depth or medium are missing.
    """
    if not table.notes:
        return {}
    known = sound_attributes(table.notes)
    for name in ("depth_m", "medium", "created_by", "source", "provenance", "smoothed", "count", *RATE, *EXPOSURE):
        if name in table.notes and name not in known:
            raise RefusedError(f"{table.path}: a comment says {name} = {table.notes[name]!r}, which can't be")
    for name in ("depth_m", "medium", "created_by", "count"):
        if name not in known:
            raise RefusedError(f"{table.path}: the comments of deepmuon-convert say no {name}")
    if known.get("target") == Plane.name and known.keys() >= {"target_size_m", EXPOSURE[0]}:
        known[EXPOSURE[1]] = math.prod(known["target_size_m"])
    return known


def of_all_rows(table: Table, known: dict[str, Any], rows: int) -> dict[str, Any]:
    """Return what is known of the rows that are there: no rate, where some are missing or were added."""
    if not known or known["count"] == rows:
        return known
    if not known.keys().isdisjoint((RATE[0], TARGET_RATE[0])):
        warnings.warn(
            f"{table.path} has {rows:,} muons, and its comments speak of {known['count']:,}: their rate is left out, "
            "state one by --rate",
            stacklevel=2,
        )
    return {name: value for name, value in known.items() if name not in (*RATE, *TARGET_RATE, *EXPOSURE)}


def check_stated(table: Table, known: Mapping[str, Any], stated: Mapping[str, Any]) -> None:
    """Refuse options that contradict what is known.

    Raises
    ------
    RefusedError
        If one does.
    """
    for option, name in OPTIONS.items():
        value = stated[option]
        if value is not None and name in known and known[name] != value:
            raise RefusedError(
                f"{table.path} says {name} = {known[name]}, and --{option.replace('_', '-')} {value}: leave it out"
            )
    if stated["live_time"] is not None and RATE[0] in known:
        raise RefusedError(f"{table.path} says {RATE[0]} = {known[RATE[0]]}: leave --live-time out")
