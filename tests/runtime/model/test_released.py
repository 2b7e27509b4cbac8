from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from deepmuon_runtime import Generator, RefusedError, list_models
from deepmuon_runtime.model.released import default_architecture, released_model, serving_models


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
    with pytest.raises(RefusedError, match=f"for a depth of {depth} m of water: cry in water has 0 and 10 m$"):
        Generator.open(depth)


@pytest.mark.usefixtures("released")
def test_an_architecture_without_a_model_is_refused_with_those_there_are():
    with pytest.raises(RefusedError, match="there are quantile and transformer"):
        Generator.open(10, "transfomer")
    with pytest.raises(RefusedError, match="for a depth of 0 m of water: cry in water has 10 m"):
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


@pytest.mark.usefixtures("released_families")
def test_a_family_wins_over_a_model_of_one_depth():
    assert Generator.open(10).model.name == "quantile-water.onnx"
    assert Generator.open(13.7).model.depth_m == 13.7
    assert Generator.open(10, "transformer").model.name == "transformer-10m.onnx"


@pytest.mark.usefixtures("released_families")
def test_the_list_has_the_default_first_and_families_before_the_depths_that_they_serve():
    assert [(model.flux, model.medium, model.depths) for model in list_models()] == [
        ("cry", "water", "0 to 100"),
        ("cry", "water", "0"),
        ("cry", "water", "10"),
        ("measured", "water", "0 to 5000"),
        ("measured", "rock", "0 to 2500"),
        ("cry", "water", "10"),
    ]
    assert [model.name for model in serving_models()] == [
        "quantile-water.onnx",
        "measured-water.onnx",
        "measured-rock.onnx",
        "transformer-10m.onnx",
    ]


@pytest.mark.usefixtures("released_families")
@pytest.mark.parametrize(
    ("chosen", "name"),
    [
        ({}, "quantile-water.onnx"),
        ({"flux": "cry"}, "quantile-water.onnx"),
        ({"medium": "water"}, "quantile-water.onnx"),
        ({"flux": "measured"}, "measured-water.onnx"),
        ({"flux": "measured", "medium": "rock"}, "measured-rock.onnx"),
        ({"architecture": "quantile", "flux": "measured", "medium": "rock"}, "measured-rock.onnx"),
        ({"architecture": "transformer", "flux": "cry", "medium": "water"}, "transformer-10m.onnx"),
    ],
)
def test_flux_and_medium_choose_the_model_and_are_its_own(chosen, name):
    model = Generator.open(10, **chosen).model
    assert model.name == name
    assert (model.flux, model.medium) == (chosen.get("flux", "cry"), chosen.get("medium", "water"))


THERE_ARE = "there are cry in water, measured in water and measured in rock"
DEPTHS = "cry in water has 0 to 100 m; measured in water has 0 to 5000 m; measured in rock has 0 to 2500 m"


@pytest.mark.usefixtures("released_families")
@pytest.mark.parametrize(
    ("depth", "chosen", "reason"),
    [
        (10, {"medium": "rock"}, f"no released model of flux cry in rock: {THERE_ARE}"),
        (10, {"flux": "gccly"}, f"no released model of flux gccly in water: {THERE_ARE}"),
        (10, {"flux": "measured", "medium": "ice\n"}, f"no released model of flux measured in 'ice\\n': {THERE_ARE}"),
        (10, {"flux": ""}, f"no released model of flux '' in water: {THERE_ARE}"),
        (10, {"medium": 3}, f"no released model of flux cry in 3: {THERE_ARE}"),
        (
            10,
            {"architecture": "transformer", "flux": "measured"},
            "no released transformer of flux measured in water: there is cry in water",
        ),
        (100.1, {}, f"no quantile model of flux cry for a depth of 100.1 m of water: {DEPTHS}"),
        (-1, {}, f"no quantile model of flux cry for a depth of -1 m of water: {DEPTHS}"),
        (float("nan"), {}, f"no quantile model of flux cry for a depth of nan m of water: {DEPTHS}"),
        (
            2500.1,
            {"flux": "measured", "medium": "rock"},
            f"no quantile model of flux measured for a depth of 2500.1 m of rock: {DEPTHS}",
        ),
    ],
)
def test_a_flux_a_medium_or_a_depth_that_is_lacking_is_refused_with_what_there_is(depth, chosen, reason):
    with pytest.raises(RefusedError, match=f"^{re.escape(reason)}$"):
        Generator.open(depth, **chosen)


@pytest.mark.usefixtures("released_families")
@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flux=st.none() | st.text(), medium=st.none() | st.text(), depth=st.floats())
def test_whatever_is_asked_for_is_found_or_refused_in_one_line(flux, medium, depth):
    try:
        assert released_model(depth, flux=flux, medium=medium).has_depth(depth)
    except RefusedError as refused:
        text = str(refused)
        assert text.isprintable()
        assert "measured in rock" in text


@pytest.mark.usefixtures("released_families")
def test_a_files_flux_and_medium_are_its_own(family_file: Path):
    for name in ("architecture", "flux", "medium"):
        with pytest.raises(RefusedError, match=f"a model's file decides its {name}"):
            Generator.open(10, file=family_file, **{name: "water"})


@pytest.mark.usefixtures("released_families")
def test_two_fluxes_and_two_media_of_a_seed_have_nothing_in_common():
    """The small families have one graph; a correlation is within 4 standard deviations: 3 pairs, 2e-4 false alarms."""
    n = 20_000
    kinds = [{"flux": "cry"}, {"flux": "measured"}, {"flux": "measured", "medium": "rock"}]
    energies = [np.log(Generator.open(10, **kind).sample(n, seed=1).kinetic_energy) for kind in kinds]
    assert np.abs(np.corrcoef(energies)[np.triu_indices(3, 1)]).max() < 4 / np.sqrt(n)
