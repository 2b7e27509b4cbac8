from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import torch
from support.engines import MODELS

from deepmuon_training.export.exportable import Exportable
from deepmuon_training.release.vectors import MARGIN, MUONS, muon_vectors

REPOSITORY = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def vectors(model: Path) -> dict:
    return json.loads(muon_vectors(model))


def rows(vectors: dict, name: str, first: int) -> np.ndarray:
    return np.array(vectors[name]).reshape(first, -1)


def test_vectors_are_whole_draws_of_a_named_file(vectors: dict, model: Path, exportable: Exportable):
    assert vectors["model"] == model.name
    assert vectors["sha256"] == hashlib.sha256(model.read_bytes()).hexdigest()
    assert vectors["muons"] == vectors["draws"] * exportable.muons_per_draw >= MUONS
    assert rows(vectors, "latent", vectors["draws"]).shape[1] == exportable.latent_size
    assert rows(vectors, "direction", vectors["muons"]).shape[1] == 3
    assert len(vectors["kinetic_energy"]) == len(vectors["charge"]) == vectors["muons"]


def test_float32_holds_the_latents_as_they_are_written(vectors: dict):
    latent = np.array(vectors["latent"])
    np.testing.assert_array_equal(np.float32(latent), np.float32([f"{x:.9g}" for x in np.float32(latent)]))
    numerators = np.float32(latent).astype(float) * 2**24
    np.testing.assert_array_equal(numerators, np.round(numerators))
    assert np.abs(latent).max() <= 1


def test_the_muons_are_pytorchs(vectors: dict, exportable: Exportable):
    latent = torch.from_numpy(np.float32(rows(vectors, "latent", vectors["draws"]))).double()
    with torch.no_grad():
        energy, direction, charge = exportable(latent)
    np.testing.assert_allclose(vectors["kinetic_energy"], energy, rtol=1e-7)
    np.testing.assert_allclose(rows(vectors, "direction", vectors["muons"]), direction, atol=1e-8)
    np.testing.assert_array_equal(vectors["charge"], charge)


def test_no_charge_is_near_its_threshold(vectors: dict, exportable: Exportable):
    latent = torch.from_numpy(rows(vectors, "latent", vectors["draws"]))
    with torch.no_grad():
        for shift in np.linspace(-MARGIN, MARGIN, 9):
            np.testing.assert_array_equal(exportable(latent + shift)[2], vectors["charge"])


def test_all_combinations_of_end_points_are_among_the_draws_of_single_muons(vectors: dict, exportable: Exportable):
    latent = rows(vectors, "latent", vectors["draws"])
    corners = latent[np.all(np.abs(latent) == 1, axis=1)]
    assert len(np.unique(corners, axis=0)) == (2**exportable.latent_size if exportable.muons_per_draw == 1 else 0)


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_the_vectors_of_a_released_model_are_those_of_its_file(path: Path):
    stored = json.loads((REPOSITORY / "tests" / "vectors" / f"{path.stem}.json").read_text(encoding="utf-8"))
    made = json.loads(muon_vectors(path))
    assert stored.keys() == made.keys()
    for key, value in made.items():
        if isinstance(value, list):
            np.testing.assert_allclose(stored[key], value, rtol=1e-8, atol=1e-9, err_msg=key)
        else:
            assert stored[key] == value, key


def test_every_file_of_vectors_has_its_released_model_of_one_depth():
    stored = (REPOSITORY / "tests" / "vectors").glob("*.json")
    assert {path.stem for path in stored} == {path.stem for path in MODELS}
