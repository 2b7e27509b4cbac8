"""The plan of the packages: rooms in layers, arrows from each to what it stands on, drawn from the imports in the code.

``python -m studies.pictures.floor_plan`` tells how many arrows there are; the docs draw the plan when they are built.
"""

from __future__ import annotations

import ast
from html import escape
from typing import NamedTuple

from studies.pictures.imports import Arrows, Import, Modules, arrows, imports, modules, package, room
from studies.pictures.layers import heights, necessary, place

__all__ = ["drawing", "rooms"]

DRAWN = ("deepmuon_training", "deepmuon_cli", "deepmuon_runtime")
"""Packages: the first one on the left, the others on the right, one under the other."""

LETTER, LINE, PADDING = 7.4, 17.0, 10.0
GAP, WAYPOINT, BETWEEN_LAYERS, MARGIN = 18.0, 8.0, 38.0, 16.0
BETWEEN_PACKAGES = 64.0


class Room(NamedTuple):
    """A room for the table."""

    name: str
    purpose: str
    """What its docstring says."""
    modules: int
    uses: list[str]
    """Other rooms of its package."""


class Part(NamedTuple):
    """The drawing of a package, and its size."""

    svg: str
    width: float
    height: float


def rooms(package_name: str) -> list[Room]:
    """Return the rooms of a package, those that others stand on last."""
    files = modules()
    uses = _inside(package_name, arrows(imports(files), files, rooms=True))
    level = heights(uses)
    names = [name for name in uses if files[name].name == "__init__.py"]
    return [
        Room(
            _short(name),
            ast.get_docstring(ast.parse(files[name].read_text(encoding="utf-8"))) or "",
            sum(module.rpartition(".")[0] == name for module in files),
            sorted(map(_short, uses[name])),
        )
        for name in sorted(names, key=lambda name: (-level[name], name))
    ]


def drawing() -> str:
    """Return the plan as SVG, in the colour of the text around it."""
    files = modules(DRAWN)
    found = imports(files)
    uses = arrows(found, files, rooms=True)
    left, *others = (_part(name, _inside(name, uses)) for name in DRAWN)
    corners, y = {DRAWN[0]: (0.0, 0.0)}, 0.0
    for name, part in zip(DRAWN[1:], others, strict=True):
        corners[name] = (left.width + BETWEEN_PACKAGES, y)
        y += part.height + BETWEEN_PACKAGES
    height = max(left.height, y - BETWEEN_PACKAGES)
    width = left.width + BETWEEN_PACKAGES + max(part.width for part in others)
    parts = dict(zip(DRAWN, (left, *others), strict=True))
    groups = "".join(
        f'<g transform="translate({corners[name][0]:.1f} {corners[name][1]:.1f})">{part.svg}</g>'
        for name, part in parts.items()
    )
    return (
        f'<svg viewBox="-2 -2 {width + 4:.1f} {height + 4:.1f}" role="img" aria-label="Rooms in layers" '
        'style="display:block;width:100%;height:auto" font-size="13" fill="currentColor" stroke="none">'
        '<defs><marker id="floor-plan-head" viewBox="0 0 8 8" refX="7.5" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0 0.8 8 4 0 7.2z" fill="currentColor"/></marker></defs>'
        f"{groups}{_between(found, files, parts, corners)}</svg>"
    )


def _short(name: str) -> str:
    return name.partition(".")[2].replace(".", "/")


def _inside(package_name: str, uses: Arrows) -> Arrows:
    """Return the arrows within a package."""
    return {
        name: {other for other in used if package(other) == package_name}
        for name, used in uses.items()
        if package(name) == package_name
    }


def _grouped(uses: Arrows, files: Modules) -> tuple[Arrows, dict[str, list[str]]]:
    """Put modules without a room that lie in one layer into one box, and return the lines of text in each box."""
    level = heights(uses)
    box = {name: name if files[name].name == "__init__.py" else f"layer {level[name]}" for name in uses}
    lines: dict[str, list[str]] = {}
    grouped: Arrows = {}
    for name, used in uses.items():
        lines.setdefault(box[name], []).append(_short(name))
        grouped.setdefault(box[name], set()).update(box[other] for other in used)
    return grouped, lines


def _part(package_name: str, uses: Arrows) -> Part:
    """Draw a package."""
    grouped, lines = _grouped(uses, modules([package_name]))
    grouped = necessary(grouped)
    level = heights(grouped)
    size = {
        name: (max(map(len, text)) * LETTER + 2 * PADDING, len(text) * LINE + PADDING) for name, text in lines.items()
    }
    middle, ways = place(grouped, {name: width for name, (width, _) in size.items()}, GAP, WAYPOINT)
    middle = {name: MARGIN + x for name, x in middle.items()}
    y, rows = MARGIN + LINE + 8, {}
    for k in sorted(set(level.values()), reverse=True):
        rows[k] = y, max(size[name][1] for name in level if level[name] == k)
        y += rows[k][1] + BETWEEN_LAYERS
    width = max([middle[name] + size[name][0] / 2 for name in size] + [MARGIN + len(package_name) * LETTER]) + MARGIN
    height = y - BETWEEN_LAYERS + MARGIN
    svg = [
        f'<rect width="{width:.1f}" height="{height:.1f}" rx="8" fill="none" stroke="currentColor" '
        'stroke-opacity="0.35" stroke-dasharray="4 3"/>',
        _text(MARGIN, MARGIN + 10, package_name, 'font-weight="bold"'),
    ]
    for way in ways:
        down = range(level[way[0]], level[way[-1]] - 1, -1)
        svg.append(_arrow(_path([middle[name] for name in way], [rows[k] for k in down], size[way[0]][1])))
    for name, text in lines.items():
        svg.append(_box(middle[name], rows[level[name]][0], *size[name], text, "." in name))
    return Part("".join(svg), width, height)


def _path(xs: list[float], rows: list[tuple[float, float]], height: float) -> str:
    """Return a curve from the lower edge of a box to the upper one of another, past the rows between (top, height)."""
    x, y = xs[0], rows[0][0] + height
    path = f"M{x:.1f} {y:.1f}"
    for k, (right, (top, high)) in enumerate(zip(xs[1:], rows[1:], strict=True), start=2):
        half = (y + top) / 2
        path += f"C{x:.1f} {half:.1f} {right:.1f} {half:.1f} {right:.1f} {top:.1f}"
        x, y = right, top + high
        if k < len(xs):
            path += f"V{y:.1f}"
    return path


def _box(middle: float, top: float, width: float, height: float, lines: list[str], is_room: bool) -> str:
    fill, edge = (0.1, 0.7) if is_room else (0, 0.4)
    texts = (_text(middle, top + LINE * (k + 1), line, 'text-anchor="middle"') for k, line in enumerate(lines))
    return (
        f'<rect x="{middle - width / 2:.1f}" y="{top:.1f}" width="{width:.1f}" height="{height:.1f}" rx="4" '
        f'fill-opacity="{fill}" stroke="currentColor" stroke-opacity="{edge}"/>{"".join(texts)}'
    )


def _between(
    found: list[Import], files: Modules, parts: dict[str, Part], corners: dict[str, tuple[float, float]]
) -> str:
    """Draw one thick arrow from package to package, and say who alone it is for."""
    importers: dict[tuple[str, str], set[str]] = {}
    for one in found:
        pair = package(one.importer), package(one.imported)
        if pair[1] in parts and pair[0] != pair[1] and one.importer not in parts:
            importers.setdefault(pair, set()).add(_short(room(one.importer, files)))
    svg = []
    for (a, b), names in sorted(importers.items()):
        (xa, ya), (xb, yb) = corners[a], corners[b]
        if xa == xb:  # one under the other
            x = xa + min(parts[a].width, parts[b].width) / 2
            svg.append(_arrow(f"M{x:.1f} {ya + parts[a].height:.1f}V{yb:.1f}", 3))
            continue
        start, end = xa + parts[a].width, xb
        y = yb + parts[b].height / 2
        svg.append(_arrow(f"M{start:.1f} {y:.1f}H{end:.1f}", 3))
        if len(names) == 1:
            words = [*names, "alone"]
            svg += [
                _text((start + end) / 2, y - 8 - LINE * k, word, 'font-size="11" text-anchor="middle"')
                for k, word in enumerate(reversed(words))
            ]
    return "".join(svg)


def _text(x: float, y: float, text: str, style: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" {style}>{escape(text)}</text>'


def _arrow(path: str, width: float = 1.2) -> str:
    return (
        f'<path d="{path}" fill="none" stroke="currentColor" stroke-opacity="0.6" stroke-width="{width}" '
        'marker-end="url(#floor-plan-head)"/>'
    )


def main() -> None:
    """Tell how many arrows there are between rooms, and which room is the largest."""
    files = modules(DRAWN)
    uses = arrows(imports(files), files, rooms=True)
    print(f"{len(uses)} rooms and modules without one, {sum(map(len, uses.values()))} arrows between them")
    for name in DRAWN:
        largest = max(rooms(name), key=lambda one: one.modules)
        print(f"{name}: {len(rooms(name))} rooms, the largest is {largest.name} with {largest.modules} modules")


if __name__ == "__main__":
    main()
