"""The guide's table of what other programs write: each command, on the guide's own files, says what stands there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.mcpl_file import mcpl_file

PAGE = (Path(__file__).parents[2] / "docs" / "training.md").read_text(encoding="utf-8")
SECTION = re.search(r"^## Your own muons\n(.*?)^## ", PAGE, re.MULTILINE | re.DOTALL)[1]
BLOCK = re.compile(r"^```(bash|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ROW = re.compile(r"^\| [^|]+ \| `([^`|]+ --format [^`|]+)` \| `([^`|]+)` \|$", re.MULTILINE)
ROWS = ROW.findall(SECTION)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of the section, and one of MCPL."""
    folder = tmp_path_factory.mktemp("files")
    for language, code in BLOCK.findall(SECTION):
        run(folder, code if language == "bash" else f"python - <<'PYTHON'\n{code}PYTHON")
    direction = [[0.6, 0.0, -0.8], [0.0, -0.28, -0.96]]
    (folder / "muons.mcpl").write_bytes(mcpl_file([13, -13], [2150.0, 830.0], direction, [1.0, 1.0]))
    return folder


def run(folder: Path, command: str) -> str:
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    options = {"cwd": folder, "env": environment, "check": True, "text": True, "timeout": 300}
    return subprocess.run(["bash", "-ec", command], stdout=subprocess.PIPE, **options).stdout


@pytest.mark.parametrize(("options", "said"), ROWS, ids=[options.split()[0] for options, _ in ROWS])
def test_a_command_of_the_table_says_what_stands_there(folder: Path, options: str, said: str):
    assert run(folder, f"deepmuon-train convert {options} -o muons.h5 --overwrite").splitlines()[0] == said


def test_the_table_has_a_row_for_each_program():
    assert {options.split()[2] for options, _ in ROWS} == {"cry-text", "csv", "npy", "mcpl", "root"}
    assert len(ROWS) == 9
