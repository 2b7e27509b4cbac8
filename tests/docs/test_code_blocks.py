"""The README's and the guides' code is run as it stands, page by page, each in an empty folder.

A block of text right below Python is what that prints.
"""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
PAGES = sorted([REPOSITORY / "README.md", *(REPOSITORY / "docs").glob("*.md")])
BLOCK = re.compile(r"^```(bash|python)\n(.*?)^```$(?:\n\n```text\n(.*?)^```$)?", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"\d+(?:\.\d+)?")

# Installing and testing are CI's work: here these commands do nothing.
PRELUDE = "set -e; pip() { :; }; pytest() { :; }\n"


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """Return language, code and the text below it of each block."""
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def check_printed(printed: str, stated: str) -> None:
    """Compare words, and numbers to one in their last digit: engines may round otherwise."""
    assert NUMBER.sub("#", printed) == NUMBER.sub("#", stated)
    for ours, theirs in zip(NUMBER.findall(printed), NUMBER.findall(stated), strict=True):
        digits = len(theirs.partition(".")[2])
        assert float(ours) == pytest.approx(float(theirs), rel=0, abs=1.01 * 10**-digits), printed


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=lambda page: page.stem)
def test_the_code_of_a_page_runs_from_top_to_bottom(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    names: dict[str, object] = {"__name__": "__main__"}
    for language, code, stated in blocks(page):
        if language == "bash":
            subprocess.run(["bash", "-c", PRELUDE + code], check=True)
            continue
        with redirect_stdout(io.StringIO()) as output:
            exec(compile(code, str(page), "exec"), names)
        print(output.getvalue())
        if stated:
            check_printed(output.getvalue(), stated)


def test_there_is_code_to_run():
    assert {page.stem for page in PAGES if blocks(page)} >= {"README", "start", "training", "onnx_contract"}
    (detectors,) = (page for page in PAGES if page.stem == "detectors")
    assert sum(stated != "" for _, _, stated in blocks(detectors)) >= 6


@pytest.mark.parametrize("printed", ["56.96 a second\n", "56.94 a minute\n", "56.94 a second\nof 3\n", "a second\n"])
def test_another_number_or_word_than_is_stated_is_noticed(printed: str):
    check_printed("56.95 a second\n", "56.94 a second\n")
    with pytest.raises(AssertionError):
        check_printed(printed, "56.94 a second\n")
