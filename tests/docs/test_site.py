from __future__ import annotations

import re
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
LINK = re.compile(r"\]\(([^)#:]+)\)")


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_links_lead_somewhere(page: str):
    targets = LINK.findall((REPOSITORY / page).read_text(encoding="utf-8"))
    assert targets
    assert [target for target in targets if not (REPOSITORY / target).exists()] == []


def test_every_module_of_training_is_in_the_reference():
    # These are programs of worker processes.
    folder = REPOSITORY / "training" / "deepmuon_training"
    paths = [path.relative_to(folder).with_suffix("") for path in folder.rglob("[a-z]*.py")]
    modules = {".".join(path.parts) for path in paths if path.parts[0] != "commands"}
    modules -= {"transport.geant4_materials", "transport.geant4_slab"}
    reference = (REPOSITORY / "docs" / "python_training.md").read_text(encoding="utf-8")
    assert set(re.findall(r"automodule:: deepmuon_training\.([\w.]+)", reference)) == modules
