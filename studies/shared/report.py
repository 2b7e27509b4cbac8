"""What studies write: numbers as JSON, a table and a picture for the site, all beside the script."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure  # not needed to write a table

__all__ = ["COLOURS", "table", "write"]

COLOURS = ("#1f4e9e", "#c1272d", "#3a7d44", "#8a5a00", "#6a3d9a", "#444444")


def write(
    script: Path, numbers: dict[str, Any], rows: Iterable[Sequence[str]] = (), figure: Figure | None = None
) -> None:
    """Write NAME.json, NAME.md (the first row is the table's head) and NAME.png beside NAME.py."""
    script.with_suffix(".json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    if rows:
        script.with_suffix(".md").write_text(table(rows), encoding="utf-8")
    if figure:
        figure.savefig(script.with_suffix(".png"), dpi=110)


def table(rows: Iterable[Sequence[str]], text_columns: int = 1) -> str:
    """Return a table in Markdown: the first row is its head, and after the first columns all is to the right."""
    head, *body = rows
    rule = ["---"] * text_columns + ["--:"] * (len(head) - text_columns)
    return "".join(f"| {' | '.join(row)} |\n" for row in (head, rule, *body))
