from __future__ import annotations

from pathlib import Path

import pytest
from support.own_input import assert_own_input_is_refused

COMMANDS = {
    "convert": "deepmuon-train convert {} --format csv",
    "convert root": "deepmuon-train convert {}:tree --format root",
    "transport": "deepmuon-train transport {} --thickness 1",
    "fit": "deepmuon-train fit {}",
    "fit with settings": "deepmuon-train fit other --settings {}",
    "export": "deepmuon-train export {}",
    "evaluate model": "deepmuon-train evaluate {} other",
    "evaluate held-out": "deepmuon-train evaluate other {}",
    "evaluate to JSON": "deepmuon-train evaluate {} other -o report.html --json",
}


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("output", ["input", "link"])
def test_its_own_input_is_refused_before_anything_is_read(tmp_path: Path, name: str, output: str):
    assert_own_input_is_refused(tmp_path, COMMANDS[name], output, ".root" if name == "convert root" else ".png")
