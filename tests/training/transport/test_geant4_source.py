from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from deepmuon_runtime import Generator, Muons
from deepmuon_training.transport.geant4_data import without_data_sets

MUONS, SEED = 2500, 7
HEIGHT, AREA = 3.0, (8.0, 2.0)
PROGRAM = Path(__file__).parents[2] / "support" / "shoot_muons.py"


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What Geant4 saw of the muons of a model: given in chunks, then as one array."""
    path = tmp_path_factory.mktemp("shoot") / "result.json"
    command = [sys.executable, PROGRAM, *(MUONS, SEED, HEIGHT, *AREA), path]
    ended = subprocess.run(list(map(str, command)), env=without_data_sets(), capture_output=True, text=True)
    assert path.exists(), ended.stderr
    seen = json.loads(path.read_text())
    assert isinstance(seen, list)
    return seen


def columns(run: dict[str, Any]) -> np.ndarray:
    return np.array(sorted(run["rows"])).T


def expected() -> Muons:
    return Generator.open(10, threads=1).sample(MUONS, SEED)


def test_every_muon_is_shot_once_and_the_run_ends_when_none_is_left(runs: list[dict[str, Any]]) -> None:
    for run in runs[:2]:
        assert run["shot"] == MUONS
        np.testing.assert_array_equal(columns(run)[0], np.arange(MUONS))


def test_muons_keep_energy_direction_charge_and_order(runs: list[dict[str, Any]]) -> None:
    muons = expected()
    for run in runs[:2]:
        _, pdg_id, energy, u, v, w, *_ = columns(run)
        np.testing.assert_array_equal(pdg_id, muons.pdg_id)
        np.testing.assert_allclose(energy, muons.kinetic_energy, rtol=1e-12)
        for found, column in ((u, muons.u), (v, muons.v), (w, muons.w)):
            np.testing.assert_allclose(found, column, atol=1e-6)  # Geant4 makes it a unit vector in double precision


def test_places_are_uniform_over_the_plane(runs: list[dict[str, Any]]) -> None:
    # Kolmogorov-Smirnov p below 1e-4 in one of two columns: one false alarm in 5000.
    *_, x, y, z = columns(runs[0])
    np.testing.assert_allclose(z, HEIGHT, rtol=1e-12)
    for place, width in ((x, AREA[0]), (y, AREA[1])):
        assert stats.kstest(place, stats.uniform(-width / 2, width).cdf).pvalue > 1e-4
    assert abs(np.corrcoef(x, y)[0, 1]) < 4 / np.sqrt(MUONS)


def test_geant4s_seed_decides_the_places(runs: list[dict[str, Any]]) -> None:
    np.testing.assert_array_equal(columns(runs[0]), columns(runs[1]))


def test_muons_that_have_places_are_given_no_others(runs: list[dict[str, Any]]) -> None:
    assert runs[2] == {"refused": "an area is for muons that have no places: give it to them, and to no others"}
