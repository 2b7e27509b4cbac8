"""What the experiments write: numbers as JSON, a table and a picture for the site, all beside the scripts."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

__all__ = ["COLOURS", "write"]

FOLDER = Path(__file__).parent
COLOURS = ("#1f4e9e", "#c1272d", "#3a7d44", "#8a5a00", "#6a3d9a", "#444444")


def write(name: str, numbers: dict[str, Any], rows: Iterable[Sequence[str]] = (), figure: Figure | None = None) -> None:
    """Write NAME.json, NAME.md (the first row is the table's head) and NAME.png."""
    (FOLDER / f"{name}.json").write_text(json.dumps(numbers, indent=1) + "\n")
    if rows:
        (FOLDER / f"{name}.md").write_text(_table([list(row) for row in rows]))
    if figure:
        figure.savefig(FOLDER / f"{name}.png", dpi=110)


def _table(rows: list[list[str]]) -> str:
    head, *body = rows
    rule = ["---", *["--:"] * (len(head) - 1)]
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, rule, *body)) + "\n"
