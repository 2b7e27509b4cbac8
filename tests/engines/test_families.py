"""A family at a depth, and what is baked of it, in every engine that ran 0.1.0's models."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.engines import (
    ENGINES,
    FAMILIES,
    MODELS,
    TOLERANCE,
    Engine,
    Muons,
    difference,
    expected,
    latents_of,
    run_in_onnxruntime,
)
from support.tiny_families import tiny_family

from deepmuon_runtime.latents.philox import latents
from deepmuon_runtime.model.baking import bake
from deepmuon_runtime.model.family import at_depth, read_model

DRAWS = 2000
BAKED_ONLY = ("OpenCV, module dnn",)
"""Engines that run models of one depth alone: they calculate nothing while they load."""
JAVASCRIPT = ("ONNX Runtime in Node.js", "ONNX Runtime in WebAssembly")


def baked_from(model: Path) -> str | None:
    """Return the hash of the family that a model was taken out of, if it was."""
    return read_model(model.read_bytes(), model.name).metadata.get("baked_from")


def here(name: str) -> Engine:
    engine = ENGINES[name]
    if engine.missing():
        pytest.skip(engine.missing())
    return engine


def model(folder: Path, name: str, contents: bytes, **more: float) -> Path:
    """Write a model and latents for it, and return its path."""
    latent = latents(1, first=0, draws=DRAWS, latent_size=read_model(contents, name).latent_size, stream=5)
    vectors = {"draws": DRAWS, "latent": latent.flatten().tolist(), **more}
    (folder / f"{name}.json").write_text(json.dumps(vectors))
    path = folder / f"{name}.onnx"
    path.write_bytes(contents)
    return path


def assert_same(found: Muons, right: Muons) -> None:
    seen = difference(found, right)
    assert seen.energy <= TOLERANCE.energy
    assert seen.direction <= TOLERANCE.direction
    assert seen.charges <= TOLERANCE.charges


@pytest.fixture(params=[0, 0.1, 13.7, 50, 100])
def depth(request: pytest.FixtureRequest) -> float:
    return request.param


@pytest.fixture
def right(tmp_path: Path, depth: float) -> Muons:
    """The muons by Python and ONNX Runtime."""
    return run_in_onnxruntime(model(tmp_path, "right", at_depth(tiny_family(), depth)))


@pytest.mark.parametrize("name", [name for name in ENGINES if name not in BAKED_ONLY])
@pytest.mark.parametrize("raw", [True, False])
def test_a_family_at_a_depth_gives_the_same_muons_everywhere(tmp_path: Path, depth, right, name: str, raw: bool):
    assert_same(here(name).run(model(tmp_path, "family", at_depth(tiny_family(raw=raw), depth))), right)


@pytest.mark.parametrize("name", JAVASCRIPT)
@pytest.mark.parametrize("raw", [True, False])
def test_the_depth_that_javascript_sets_is_pythons(tmp_path: Path, depth, right, name: str, raw: bool):
    assert_same(here(name).run(model(tmp_path, "family", tiny_family(raw=raw), depth_m=depth)), right)


@pytest.mark.parametrize("name", ENGINES)
def test_a_baked_model_gives_the_same_muons_everywhere(tmp_path: Path, depth, right, name: str):
    assert_same(here(name).run(model(tmp_path, "baked", bake(tiny_family(), depth))), right)


@pytest.mark.parametrize("name", [name for name in ENGINES if name not in BAKED_ONLY])
@pytest.mark.parametrize("fixed", [model for model in MODELS if baked_from(model)], ids=lambda model: model.stem)
def test_a_released_family_gives_the_vectors_of_what_was_baked_of_it(tmp_path: Path, fixed: Path, name: str):
    (family,) = (path for path in FAMILIES if read_model(path.read_bytes(), path.name).sha256 == baked_from(fixed))
    vectors = {"draws": len(latents_of(fixed)), "latent": latents_of(fixed).flatten().tolist()}
    placed = at_depth(family.read_bytes(), read_model(fixed.read_bytes(), fixed.name).depth_m)
    (tmp_path / "family.json").write_text(json.dumps(vectors))
    (tmp_path / "family.onnx").write_bytes(placed)
    assert_same(here(name).run(tmp_path / "family.onnx"), expected(fixed))


@pytest.mark.parametrize("name", [name for name in ENGINES if name not in BAKED_ONLY])
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.stem)
def test_a_released_family_gives_the_same_muons_everywhere(tmp_path: Path, family: Path, name: str):
    contents = family.read_bytes()
    deepest = read_model(contents, family.name).depth_max_m
    assert deepest is not None
    placed = at_depth(contents, 0.7 * deepest)
    assert_same(here(name).run(model(tmp_path, "family", placed)), run_in_onnxruntime(model(tmp_path, "right", placed)))


def test_another_depth_is_seen(tmp_path: Path, depth, right):
    other = run_in_onnxruntime(model(tmp_path, "other", at_depth(tiny_family(), 60)))
    assert difference(other, right).energy > TOLERANCE.energy
    assert not np.array_equal(other.charge, right.charge) or depth == 50
