"""The guide's way from nothing to a model, as it stands there, with fewer muons."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "training.md"
SECTION = re.compile(r"^## From nothing to a model\n(.*?)^## ", re.MULTILINE | re.DOTALL)
FEWER = {"-n 1e6": "-n 120_000", "-n 5e5": "-n 100_000"}  # of which an evaluation needs as many


def replaced(text: str, changes: dict[str, str]) -> str:
    for old, new in changes.items():
        assert old in text, f"the guide no longer says {old}"
        text = text.replace(old, new)
    return text


def test_five_commands_go_from_nothing_to_a_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    section = SECTION.search(PAGE.read_text(encoding="utf-8"))
    assert section is not None
    commands = re.search(r"```text\n(.*?)```", section[1], re.DOTALL)[1]
    subprocess.run(["bash", "-ec", replaced(commands, FEWER)], cwd=tmp_path, check=True, timeout=900)
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "KS energy" in report
    assert "data:image" in report
