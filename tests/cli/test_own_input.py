from __future__ import annotations

from pathlib import Path

import pytest
from support.own_input import assert_own_input_is_refused

COMMANDS = {
    "gen": "deepmuon-gen --model {} -n 10",
    "convert": "deepmuon-convert {}",
    "plot": "deepmuon-plot other {}",
}


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("output", ["input", "link"])
def test_its_own_input_is_refused_before_anything_is_read(tmp_path: Path, name: str, output: str):
    assert_own_input_is_refused(tmp_path, COMMANDS[name], output)
