"""What the attributes of a muon file say of the choice of its muons: cuts and a target."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from deepmuon_runtime.cuts import NO_CUTS, Cuts
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.targets.by_name import target_of
from deepmuon_runtime.targets.target import Target

__all__ = ["choice_defects", "cuts_of", "target_of_file"]

CUTS = ("energy_min_gev", "energy_max_gev", "zenith_min_degrees", "zenith_max_degrees")


def cuts_of(sound: Mapping[str, Any]) -> Cuts:
    """Return the cuts of a file; none where they can't be.

    Parameters
    ----------
    sound
        Its attributes that are what they can be.
    """
    try:
        return Cuts(*(sound.get(name) for name in CUTS))
    except RefusedError:
        return NO_CUTS


def target_of_file(sound: Mapping[str, Any]) -> Target | None:
    """Return the target of a file; None where there is none, or it is none of DeepMuon's own."""
    try:
        return target_of(sound.get("target", ""), sound.get("target_size_m", ()))
    except RefusedError:
        return None


def choice_defects(sound: Mapping[str, Any]) -> Iterator[str]:
    """Yield how cuts and target of a file can't be what they are."""
    try:
        Cuts(*(sound.get(name) for name in CUTS))
    except RefusedError as error:
        yield f"the cuts can't be: {error}"
    try:
        target_of(sound.get("target", ""), sound.get("target_size_m", ()))
    except RefusedError as error:
        yield f"the target can't be: {error}"
    if "target_size_m" in sound and "target" not in sound:
        yield "target_size_m goes with target, which is not there"
    if "target" in sound and "rate_hz_per_m2" in sound:
        yield "rate_hz_per_m2 goes without target, which has a rate of its own, target_rate_hz"
