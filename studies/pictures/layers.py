"""Boxes in layers, with arrows from each to what it stands on: where they lie, so that few arrows cross.

After K. Sugiyama, S. Tagawa and M. Toda, IEEE Trans. Syst. Man Cybern. 11 (1981) 109: layers by the longest path,
waypoints where an arrow crosses a layer, and the order in a layer by the mean place of the neighbours.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from statistics import mean

__all__ = ["heights", "necessary", "place"]

Arrows = Mapping[str, set[str]]
Way = tuple[str, ...]
"""An arrow: its first and last name, and a waypoint for each layer between."""

SWEEPS = 12


def heights(arrows: Arrows) -> dict[str, int]:
    """Return the layer of each name: 0 if it uses none, else one above the highest that it uses."""
    found: dict[str, int] = {}

    def height(name: str) -> int:
        if name not in found:
            found[name] = 1 + max(map(height, arrows[name]), default=-1)
        return found[name]

    for name in sorted(arrows):
        height(name)
    return found


def necessary(arrows: Arrows) -> dict[str, set[str]]:
    """Leave out the arrows that follow from others."""

    def reached(name: str) -> set[str]:
        return arrows[name].union(*map(reached, arrows[name]))

    return {name: used - set().union(*map(reached, used)) for name, used in arrows.items()}


def place(
    arrows: Arrows, widths: Mapping[str, float], gap: float, waypoint: float
) -> tuple[dict[str, float], list[Way]]:
    """Return the middle of each name and waypoint from left to right, from 0 on, and the ways of all arrows.

    Parameters
    ----------
    arrows
        Names and those that they use.
    widths
        Of the boxes.
    gap
        Between two boxes.
    waypoint
        Width that is left for an arrow that passes.
    """
    layer = heights(arrows)
    width = dict(widths)
    ways: list[Way] = []
    for name in sorted(arrows):
        for used in sorted(arrows[name]):
            passed = [f"{name} > {used} {between}" for between in range(layer[name] - 1, layer[used], -1)]
            ways.append((name, *passed, used))
            for point, between in zip(passed, range(layer[name] - 1, layer[used], -1), strict=True):
                layer[point], width[point] = between, waypoint
    rows = [sorted(name for name in layer if layer[name] == level) for level in range(max(layer.values()) + 1)]
    near: dict[str, list[str]] = {name: [] for name in layer}
    for a, b in (step for way in ways for step in pairwise(way)):
        near[a].append(b)
        near[b].append(a)
    middle = {name: float(k) for row in rows for k, name in enumerate(row)}
    for sweep in range(SWEEPS):
        for row in rows if sweep % 2 else reversed(rows):
            wanted = {name: mean([middle[other] for other in near[name]] or [middle[name]]) for name in row}
            row.sort(key=lambda name: (wanted[name], name))
            _spread(row, wanted, width, gap, middle)
    left = min(middle[name] - width[name] / 2 for name in middle)
    return {name: x - left for name, x in middle.items()}, ways


def _spread(
    row: list[str], wanted: Mapping[str, float], width: Mapping[str, float], gap: float, middle: dict[str, float]
) -> None:
    """Put the names of a row as near to where they are wanted as their widths allow, in their order."""
    at: list[float] = []
    for k, name in enumerate(row):
        least = at[-1] + (width[row[k - 1]] + width[name]) / 2 + gap if at else wanted[name]
        at.append(max(wanted[name], least))
    shift = mean([wanted[name] - x for name, x in zip(row, at, strict=True)])
    middle.update({name: x + shift for name, x in zip(row, at, strict=True)})
