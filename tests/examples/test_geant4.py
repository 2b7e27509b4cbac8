from __future__ import annotations

import subprocess
import sys
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "examples" / "geant4" / "tank.py"


def test_the_tank_is_simulated_with_the_sphere_and_without_and_drawn(tmp_path: Path) -> None:
    picture = tmp_path / "tank.png"
    command = [sys.executable, str(EXAMPLE), "-n", "400", "--depth", "10", "-o", str(picture)]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert picture.read_bytes().startswith(b"\x89PNG")
    lines = ended.stdout.splitlines()
    assert lines[0] == "400 muons entered the tank."
    crossed = row(lines, "crossed its bottom")
    assert all(0 < int(count.split()[0]) < 400 for count in crossed)
    reached = {name: row(lines, name)[0] for name in ("drawn from the model", "through 10 m", "the same")}
    assert all(count.endswith("of 1,200") for count in reached.values())
    # All that are drawn at the tank's top reach it, but for a few at its edges; from a hundred times the area few do.
    assert number(reached["drawn from the model"]) > 1150
    assert max(number(reached["through 10 m"]), number(reached["the same"])) < 120


def row(lines: list[str], name: str) -> list[str]:
    """Return the cells of the table row that has a name."""
    (line,) = (line for line in lines if line.startswith(f"| {name}"))
    return [cell.strip() for cell in line.strip("|").split("|")[1:]]


def number(cell: str) -> int:
    return int(cell.split()[0].replace(",", ""))
