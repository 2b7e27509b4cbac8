"""A terminal in place of stderr."""

from __future__ import annotations

import io
import sys

import pytest

__all__ = ["Terminal", "terminal"]


class Terminal(io.StringIO):
    """What was written to it, as text."""

    def isatty(self) -> bool:
        """Say that it is one."""
        return True


def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Put a terminal in place of stderr, until the test ends."""
    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    return shown
