"""How far a long computation is: a bar on a terminal, a line every half minute in a log."""

from __future__ import annotations

import sys
from typing import Any

from tqdm import tqdm

__all__ = ["progress_bar"]

BETWEEN_LINES = 30.0  # s


def progress_bar(total: int, name: str, unit: str, *, hidden: bool, initial: int = 0) -> tqdm[Any]:
    """Return a bar on stderr; where that is no terminal, one that writes a line every half minute.

    Parameters
    ----------
    total, initial
        Of the units, how many there are and how many are done.
    name, unit
        What is done, and what is counted.
    hidden
        Whether nothing is shown at all.
    """
    facts: dict[str, Any] = {"total": total, "initial": initial, "desc": name, "unit": unit, "disable": hidden}
    if total >= 1_000_000:
        facts["unit_scale"] = True
    if sys.stderr.isatty():
        return tqdm(**facts, mininterval=0.5)
    # A run that is over within half a minute leaves no line.
    return tqdm(**facts, mininterval=BETWEEN_LINES, delay=BETWEEN_LINES, miniters=1, ncols=100, file=_Lines())


class _Lines:
    """Stderr, with a line for each state of a bar instead of one that is written over."""

    def write(self, text: str) -> None:
        """Write a state of the bar."""
        line = text.strip()
        if line:
            sys.stderr.write(line + "\n")

    def flush(self) -> None:
        """Write what is kept."""
        sys.stderr.flush()
