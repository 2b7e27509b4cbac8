"""The directive ``quality``: how good the released models are at every depth, as one figure, from their evaluations.

::

    ```{quality} evaluations
    ```

The folder, relative to the page, holds NAME.json as `deepmuon_training.scores.evaluation.Evaluation` writes it. A
panel for each depth shows generated over held-out muons by energy, with the errors of both; over it stands delta, the
relative difference in a cell of energy and angle beyond statistics. The figure takes the theme's colours.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

__all__ = ["setup"]

PANEL, GAP = (190, 120), (56, 58)  # px, width and height
COLUMNS = 3
ENERGIES = (0.1, 1000.0)  # GeV
DEVIATION = 0.05  # at the ends of the axis

Evaluations = dict[float, dict[str, dict[str, Any]]]  # by depth, by architecture


class Quality(SphinxDirective):
    """The directive."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Draw the figure."""
        folder = Path(self.env.doc2path(self.env.docname)).parent / self.arguments[0]
        evaluations: Evaluations = {}
        for file in sorted(folder.glob("*.json")):
            self.env.note_dependency(str(file))
            architecture, _, depth = file.stem.partition("-")
            found = json.loads(file.read_text(encoding="utf-8"))
            evaluations.setdefault(float(depth.removesuffix("m")), {})[architecture] = found
        return [nodes.raw("", figure(evaluations), format="html")]


def figure(evaluations: Evaluations) -> str:
    """Return the figure as HTML."""
    rows = math.ceil(len(evaluations) / COLUMNS)
    width = COLUMNS * (PANEL[0] + GAP[0]) + 20
    height = rows * (PANEL[1] + GAP[1]) + 10
    panels = []
    for number, depth in enumerate(sorted(evaluations)):
        row, column = divmod(number, COLUMNS)
        x, y = 40 + column * (PANEL[0] + GAP[0]), 34 + row * (PANEL[1] + GAP[1])
        panels.append(f'<g transform="translate({x} {y})">{panel(depth, evaluations[depth])}</g>')
    return (
        f'<figure class="quality"><svg viewBox="0 0 {width} {height}" role="img" aria-label="Generated over held-out '
        f'muons by energy, at each depth">{"".join(panels)}</svg><figcaption>Generated over held-out muons by kinetic '
        'energy / GeV, with the errors of both. <b class="quantile">quantile</b>, <b class="transformer">transformer'
        "</b>; the numbers are their delta.</figcaption></figure>"
    )


def panel(depth: float, models: dict[str, dict[str, Any]]) -> str:
    """Return the panel of a depth."""
    width, height = PANEL
    parts = [f'<rect class="axis" width="{width}" height="{height}"/>']
    parts.append(f'<path class="axis" d="M0 {height / 2}H{width}"/>')
    parts += [
        f'<text x="{along(energy):.1f}" y="{height + 14}" text-anchor="middle">{energy:g}</text>'
        for energy in (0.1, 1, 10, 100, 1000)
    ]
    parts += [
        f'<text x="-4" y="{up(value) + 4:.1f}" text-anchor="end">{100 * value:.0f} %</text>'
        for value in (-DEVIATION, 0, DEVIATION)
    ]
    parts.append(f'<text x="0" y="-6">{"sea level" if depth == 0 else f"{depth:g} m"}</text>')
    for number, (name, found) in enumerate(sorted(models.items())):
        delta = 100 * found["cells"]["delta"]
        parts.append(f'<g class="{name}"><text x="{70 + 70 * number}" y="-6">δ {delta:.2f} %</text>')
        parts += [point(each, 2 * number - 1) for each in found["energy_bins"] if inside(each)]
        parts.append("</g>")
    return "".join(parts)


def point(each: dict[str, float], shift: float) -> str:
    """Return the deviation in a bin of energy and its error."""
    x = along(math.sqrt(each["low"] * each["high"])) + shift
    low, middle, high = (up(each["deviation"] + sign * each["error"]) for sign in (-1, 0, 1))
    dot = f'<circle cx="{x:.1f}" cy="{middle:.1f}" r="1.8" fill="currentColor"/>'
    return f'<path d="M{x:.1f} {low:.1f}V{high:.1f}" stroke="currentColor"/>{dot}'


def inside(each: dict[str, float]) -> bool:
    """Tell whether a bin of energy is on the axis."""
    return ENERGIES[0] <= each["low"] and each["high"] <= 1.001 * ENERGIES[1]


def along(energy: float) -> float:
    """Return the place of an energy [GeV] on a panel."""
    return PANEL[0] * math.log(energy / ENERGIES[0]) / math.log(ENERGIES[1] / ENERGIES[0])


def up(deviation: float) -> float:
    """Return the place of a deviation on a panel; one beyond the axis lies at its end."""
    return PANEL[1] / 2 * (1 - max(-1, min(1, deviation / DEVIATION)))


def setup(app: Sphinx) -> ExtensionMetadata:
    """Add the directive."""
    app.add_directive("quality", Quality)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
