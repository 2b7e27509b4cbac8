"""What a muon file says of the choice of its muons, cuts and a target, and whether their places and times can be so."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.cuts import NO_CUTS, Cuts
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muon_file.format import PLACE
from deepmuon_runtime.targets.by_name import target_of
from deepmuon_runtime.targets.target import Target

__all__ = ["PlacesAndTimes", "choice_defects", "cuts_of", "target_of_file"]

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


class PlacesAndTimes:
    """Looks at the optional columns of muons, piece after piece.

    Parameters
    ----------
    live_time
        The seconds in which the muons came, where that is known.
    target
        What all of them hit, where that is known.
    """

    def __init__(self, live_time: float | None, target: Target | None) -> None:
        self._target = target
        self._end = np.inf if live_time is None else live_time
        self._latest = 0.0

    def faults(self, columns: Mapping[str, NDArray[Any]]) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        """Yield what is wrong with the next muons, in words that follow "the muon", and with which: bool [n].

        Parameters
        ----------
        columns
            The columns of the muons, of which the optional ones are looked at.
        """
        place = [columns[name] for name in PLACE if name in columns]
        if place:
            yield "has a place that is not finite", ~np.isfinite(np.stack(place)).all(axis=0)
        if place and self._target is not None:
            direction = [columns[name].astype(float) for name in ("u", "v", "w")]
            with np.errstate(all="ignore"):  # the file may hold anything
                touches = self._target.touches(*(part.astype(float) for part in place), *direction)
            where = "on" if self._target.surface == 0 else "where it enters"
            yield f"is not {where} the {self._target.name}", ~touches
        time = columns.get("time")
        if time is not None and len(time):
            before = np.concatenate([[self._latest], time[:-1]])
            self._latest = time[-1]
            yield "has a time that is not finite and from 0 on", ~(np.isfinite(time) & (time >= 0))
            yield "comes before the muon before it", time < before
            yield f"comes after the live time of {self._end:g} s", time > self._end
