"""The README's and the guides' code is run as it stands, page by page, each in an empty folder."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
PAGES = sorted([REPOSITORY / "README.md", *(REPOSITORY / "docs").glob("*.md")])
BLOCK = re.compile(r"^```(bash|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)

# Installing and testing are CI's work: here these commands do nothing.
PRELUDE = "set -e; pip() { :; }; pytest() { :; }\n"


def blocks(page: Path) -> list[tuple[str, str]]:
    return BLOCK.findall(page.read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=lambda page: page.stem)
def test_the_code_of_a_page_runs_from_top_to_bottom(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    names: dict[str, object] = {"__name__": "__main__"}
    for language, code in blocks(page):
        if language == "bash":
            subprocess.run(["bash", "-c", PRELUDE + code], check=True)
        else:
            exec(compile(code, str(page), "exec"), names)


def test_there_is_code_to_run():
    assert {page.stem for page in PAGES if blocks(page)} >= {"README", "start", "training", "onnx_contract"}
