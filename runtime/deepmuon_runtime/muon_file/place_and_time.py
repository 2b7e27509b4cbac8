"""Whether places and times can be those of muons that hit a target one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.muon_file.format import PLACE
from deepmuon_runtime.targets.target import Target

__all__ = ["PlacesAndTimes"]


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
