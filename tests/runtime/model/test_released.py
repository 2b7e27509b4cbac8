from __future__ import annotations

import json
from pathlib import Path

import pytest

from deepmuon_runtime import Generator, RefusedError, list_models
from deepmuon_runtime.model.released import default_architecture


@pytest.mark.usefixtures("released")
def test_models_are_listed_by_architecture_and_depth():
    assert [(model.architecture, model.depth_m) for model in list_models()] == [
        ("quantile", 0.0),
        ("quantile", 10.0),
        ("transformer", 10.0),
    ]
    assert default_architecture() == "quantile"


@pytest.mark.usefixtures("released")
def test_the_list_says_what_the_files_say():
    for model in list_models():
        opened = Generator.open(model.depth_m, model.architecture)
        assert opened.model == model


@pytest.mark.usefixtures("released")
@pytest.mark.parametrize("depth", [12, float("nan"), -10])
def test_a_depth_without_a_model_is_refused_with_those_there_are(depth):
    with pytest.raises(RefusedError, match="there are 0 and 10 m"):
        Generator.open(depth)


@pytest.mark.usefixtures("released")
def test_an_architecture_without_a_model_is_refused_with_those_there_are():
    with pytest.raises(RefusedError, match="there are quantile and transformer"):
        Generator.open(10, "transfomer")
    with pytest.raises(RefusedError, match="no transformer model for a depth of 0 m: there is 10 m"):
        Generator.open(0, "transformer")


def test_a_changed_model_is_refused(released: Path):
    file = released / "deepmuon_models" / "quantile-10m.onnx"
    content = bytearray(file.read_bytes())
    content[-1] ^= 1
    file.write_bytes(content)
    with pytest.raises(RefusedError, match="is damaged"):
        Generator.open(10)
    assert Generator.open(0).sample(1)


def test_a_missing_model_is_refused(released: Path):
    (released / "deepmuon_models" / "quantile-10m.onnx").unlink()
    with pytest.raises(RefusedError, match=r"quantile-10m\.onnx is missing"):
        Generator.open(10)


@pytest.mark.parametrize("manifest", [None, "no JSON", json.dumps({"manifest_version": 2})])
def test_an_installation_without_its_models_says_so(released: Path, manifest):
    file = released / "deepmuon_models" / "manifest.json"
    file.unlink() if manifest is None else file.write_text(manifest)
    with pytest.raises(RefusedError, match="install deepmuon-runtime again"):
        list_models()


@pytest.mark.usefixtures("released_family")
def test_a_family_wins_over_a_model_of_one_depth():
    assert Generator.open(10).model.name == "quantile-water.onnx"
    assert Generator.open(13.7).model.depth_m == 13.7
    assert Generator.open(10, "transformer").model.name == "transformer-10m.onnx"
    assert [model.depths for model in list_models()] == ["0", "10", "0 to 100", "10"]


@pytest.mark.usefixtures("released_family")
@pytest.mark.parametrize("depth", [100.1, -1, float("nan")])
def test_a_depth_outside_a_family_is_refused_with_its_range(depth):
    with pytest.raises(RefusedError, match="there are 0 to 100, 0 and 10 m"):
        Generator.open(depth)
