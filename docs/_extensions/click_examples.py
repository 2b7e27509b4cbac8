"""Examples in the help of a command are code on its page: what stands indented after click's backspace."""

from __future__ import annotations

import click
from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

__all__ = ["setup"]

KEPT = "| "  # before each line that click is told to leave as it is
INDENT = "    "


def show_code(app: Sphinx, context: click.Context, lines: list[str]) -> None:
    """Turn the indented lines of a help into blocks of code, in place."""
    shown: list[str] = []
    in_code = False
    for line in lines:
        code = line.startswith(KEPT + INDENT)
        if code and not in_code:
            language = "console" if line.startswith(f"{KEPT}{INDENT}$ ") else "text"
            shown += ["", f".. code-block:: {language}", ""]
        if in_code and not code:
            shown.append("")
        shown.append(line.removeprefix(KEPT) if code else line)
        in_code = code
    lines[:] = shown


def setup(app: Sphinx) -> ExtensionMetadata:
    """Listen to sphinx-click."""
    app.setup_extension("sphinx_click")
    app.connect("sphinx-click-process-description", show_code)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
