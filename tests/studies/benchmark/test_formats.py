from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("uproot", reason="the extra `root` is not installed")


def test_every_format_is_measured(tmp_path):
    words = [sys.executable, "-m", "studies.benchmark.formats", "-n", "1000", "--repetitions", "1"]
    done = subprocess.run([*words, "--output", tmp_path / "out.md"], cwd=Path(__file__).parents[3])
    assert done.returncode == 0
    rows = [line.split(" | ") for line in (tmp_path / "out.md").read_text().splitlines() if line.startswith("| `.")]
    assert [row[0] for row in rows] == ["| `.h5`", "| `.mcpl`", "| `.mcpl.gz`", "| `.root`", "| `.csv`", "| `.csv.gz`"]
    sizes = {row[0]: float(row[4]) for row in rows}
    assert sizes["| `.csv`"] > sizes["| `.csv.gz`"]
