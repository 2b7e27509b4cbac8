from __future__ import annotations

import os
from pathlib import Path

import pytest

from deepmuon_training.transport.geant4_data import without_data_sets


def test_geant4_finds_an_empty_table_of_ions_and_the_rest_of_the_environment_stays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("G4ENSDFSTATEDATA", raising=False)
    environment = without_data_sets()
    assert (Path(environment["G4ENSDFSTATEDATA"]) / "ENSDFSTATE.dat").read_bytes() == b""
    assert environment.items() >= dict(os.environ).items()


def test_data_sets_that_the_user_has_named_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("G4LEDATA", "/data/G4EMLOW")
    assert without_data_sets()["G4LEDATA"] == "/data/G4EMLOW"


def test_the_environment_of_this_process_is_not_changed() -> None:
    before = dict(os.environ)
    without_data_sets()
    assert dict(os.environ) == before
