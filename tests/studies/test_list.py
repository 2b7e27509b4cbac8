from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

import pytest

STUDIES = Path(__file__).parents[2] / "studies"
SCRIPTS = {
    path.relative_to(STUDIES).with_suffix("").as_posix()
    for path in STUDIES.rglob("*.py")
    if '__name__ == "__main__"' in path.read_text(encoding="utf-8")
}
PARTS = {"benchmark/job", "benchmark/paper_size"}
"""Programs that a study starts itself."""


def test_the_readme_lists_every_study():
    _, *sections = (STUDIES / "README.md").read_text(encoding="utf-8").split("\n## ")
    listed = {
        f"{section.split(':')[0].strip('`')}/{name}"
        for section in sections
        for name in re.findall(r"^\| `(\w+)`:", section, re.MULTILINE)
    }
    assert listed == SCRIPTS - PARTS


@pytest.mark.parametrize("script", sorted(SCRIPTS))
def test_a_study_finds_all_that_it_uses(script: str):
    import_module(f"studies.{script.replace('/', '.')}")
