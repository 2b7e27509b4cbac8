"""The directive ``score-summary``: the scores of all released models in short, a row each, from their evaluations.

::

    ```{score-summary} evaluations
    ```

The folder, relative to the page, holds NAME.json as `deepmuon_training.scores.evaluate.Evaluation` writes it.
"""

from __future__ import annotations

from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

from deepmuon_training.scores.evaluation import Evaluation
from deepmuon_training.scores.score import Score
from deepmuon_training.scores.scorecard import scorecard

__all__ = ["setup"]

COLUMNS = {
    "KS energy": "KS energy",
    "KS cos zenith": "KS cos zenith",
    "cos θ < 0.05": "cos zenith 0 to",
    "0.05 to 0.1": "cos zenith 0.05",
    "0.1 to 0.15": "cos zenith 0.1 to",
    "0.15 to 0.2": "cos zenith 0.15",
    "delta": "cells: delta",
    "worst bin": "energy bin",
    "charge χ²/ndf": "charge by cell",
    "AUC": "classifier",
}
"""Heads, and how the score's name begins."""


class ScoreSummary(SphinxDirective):
    """The directive."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Make the table."""
        folder = Path(self.env.doc2path(self.env.docname)).parent / self.arguments[0]
        files = sorted(folder.glob("*.json"), key=_architecture_and_depth)
        head = ["model", *COLUMNS, "met", "missed", "too few"]
        lines = [head, ["---", *["--:"] * (len(head) - 1)], *(_row(file) for file in files)]
        for file in files:
            self.env.note_dependency(str(file))
        return self.parse_text_to_nodes("\n".join(f"| {' | '.join(line)} |" for line in lines))


def _architecture_and_depth(file: Path) -> tuple[str, int]:
    architecture, _, depth = file.stem.partition("-")
    return architecture, int(depth.removesuffix("m"))


def _row(file: Path) -> list[str]:
    scores = scorecard(Evaluation.from_json(file.read_text(encoding="utf-8")), _architecture_and_depth(file)[0])
    verdicts = [score.verdict for score in scores]
    counts = [str(verdicts.count(verdict)) for verdict in ("met", "missed", "too few muons to tell")]
    values = [_value(scores, name) for name in COLUMNS.values()]
    return [file.stem.replace("-", " "), *values, *counts]


def _value(scores: tuple[Score, ...], beginning: str) -> str:
    value = next(score.value for score in scores if score.name.startswith(beginning))
    return "undefined" if value is None else f"{value:.4g}"


def setup(app: Sphinx) -> ExtensionMetadata:
    """Add the directive."""
    app.add_directive("score-summary", ScoreSummary)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
