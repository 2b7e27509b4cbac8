"""Families: any depth from one file."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from onnx import numpy_helper
from support.damage import DAMAGES
from support.tiny_families import REFINED, tiny_family, tiny_rate, tiny_tables
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, RefusedError
from deepmuon_runtime.latents.philox import latents
from deepmuon_runtime.model.family import at_depth, depth_text
from deepmuon_runtime.model.opening import checked_model, load_model

depths = st.floats(0, 100, width=32)


def refusal(contents: bytes, depth: Any = 10, surface: Any = 0) -> str:
    with pytest.raises(RefusedError) as refused:
        at_depth(contents, depth, surface, "family.onnx")
    assert "\n" not in str(refused.value)
    return str(refused.value)


def initializers(contents: bytes) -> dict[str, np.ndarray]:
    return {tensor.name: numpy_helper.to_array(tensor) for tensor in onnx.load_from_string(contents).graph.initializer}


def texts(contents: bytes) -> dict[str, str]:
    return {entry.key: entry.value for entry in onnx.load_from_string(contents).metadata_props}


@pytest.mark.parametrize("raw", [True, False])
@pytest.mark.parametrize("surface", [0, 1])
@settings(deadline=None)
@given(depth=depths)
def test_only_the_depth_and_the_surface_change_and_the_metadata_follows(raw: bool, surface: int, depth: float):
    before = tiny_family(raw=raw)
    after = at_depth(before, depth, surface)
    onnx.checker.check_model(onnx.load_from_string(after), full_check=True)
    expected = {**initializers(before), "depth_m": np.float32(depth), "surface": np.int32(surface)}
    found = initializers(after)
    assert found.keys() == expected.keys()
    assert all(np.array_equal(found[name], expected[name]) for name in expected)
    assert found["depth_m"].shape == found["surface"].shape == ()
    said = texts(after)
    assert np.float32(said["deepmuon.depth_m"]) == np.float32(depth)
    assert said == {
        **texts(before),
        "deepmuon.depth_m": said["deepmuon.depth_m"],
        "deepmuon.surface": str(surface),
    }


def test_the_same_numbers_are_the_same_bytes_whatever_was_there_before():
    family = tiny_family()
    once = at_depth(family, 13.7, 1)
    assert at_depth(at_depth(at_depth(family, 99.5), 0.25, 1), 13.7, 1) == once
    assert abs(len(once) - len(family)) < 4


@given(depth=depths)
@example(depth=-0.0)
def test_a_depth_is_the_float32_nearest_to_what_is_asked_for_and_its_shortest_text(depth: float):
    text = depth_text(depth)
    assert np.float32(text) == np.float32(depth)
    assert not text.startswith("-")
    assert depth_text(float(text)) == text


def muons_of_tables(seed: int, n: int, depth: float, generator: Generator) -> tuple[np.ndarray, ...]:
    """Return energies, cosines and charges in float64, from the maps alone."""
    latent = latents(seed, first=0, draws=n, latent_size=4, stream=generator.model.stream).astype(float)
    log_energy, cosine, threshold = tiny_tables(depth)
    index = ((np.float32(latent[:, :2]) + np.float32(1)) * np.float32((REFINED - 1) / 2)).astype(int)

    def refined(table: np.ndarray, at: np.ndarray) -> np.ndarray:
        return np.interp(at / (REFINED - 1), np.linspace(0, 1, len(table)), table)

    energy, cos_zenith = np.exp(refined(log_energy, index[:, 0])), refined(cosine, index[:, 1])
    return energy, cos_zenith, np.where(latent[:, 3] > threshold[0], 1, -1)


@pytest.mark.parametrize("depth", [0, 0.1, 13.7, 50, 87.25, 100])
def test_the_muons_of_a_depth_are_those_of_its_interpolated_maps(family_file: Path, depth: float):
    generator = Generator.open(depth, file=family_file)
    muons = generator.sample(5000, seed=3)
    energy, cos_zenith, charge = muons_of_tables(3, 5000, depth, generator)
    np.testing.assert_allclose(muons.kinetic_energy, energy, rtol=1e-5)
    np.testing.assert_allclose(muons.cos_zenith, cos_zenith, atol=1e-6)
    np.testing.assert_array_equal(muons.charge, charge)


@pytest.mark.parametrize("depth", [0, 13.7, 100])
def test_the_rate_is_that_of_the_depth_with_its_relative_uncertainty(family_file: Path, depth: float):
    model = Generator.open(depth, file=family_file).model
    assert model.rate_hz_per_m2 == pytest.approx(tiny_rate(depth), rel=1e-4)
    assert model.rate_uncertainty_hz_per_m2 == pytest.approx(0.002 * tiny_rate(depth), rel=1e-2)
    _, sphere, _ = load_model(*checked_model(at_depth(family_file.read_bytes(), depth, 1), "a family"), "cpu")
    assert sphere.rate_hz_per_m2 == pytest.approx(tiny_rate(depth, 1), rel=1e-4)


def test_a_family_loaded_as_it_is_is_a_model_of_its_default_depth(family_file: Path):
    whole, asked = Generator.open(file=family_file), Generator.open(10, file=family_file)
    assert whole.model == asked.model
    assert whole.model.depth_m == 10
    assert np.array_equal(whole.sample(100, 1).kinetic_energy, asked.sample(100, 1).kinetic_energy)
    session = onnxruntime.InferenceSession(family_file.read_bytes())
    latent = latents(1, first=0, draws=100, latent_size=4, stream=whole.model.stream)
    (energy,) = session.run(["kinetic_energy"], {"latent": latent})
    np.testing.assert_allclose(energy, whole.sample(100, 1).kinetic_energy, rtol=1e-6)


def test_the_hash_and_size_are_those_of_the_file_as_it_was_shipped_whatever_the_depth(family_file: Path):
    models = [Generator.open(depth, file=family_file).model for depth in (None, 0, 13.7)]
    assert len({(model.sha256, model.size) for model in models}) == 1
    assert models[0].size == family_file.stat().st_size


def test_two_depths_have_streams_of_their_own_and_so_have_two_surfaces(family_file: Path):
    contents = family_file.read_bytes()
    streams = {
        load_model(*checked_model(at_depth(contents, depth, surface), "a family"), "cpu")[1].stream
        for depth in (0, 10, 13.7)
        for surface in (0, 1)
    }
    assert len(streams) == 6


@pytest.mark.parametrize("depth", [np.float32(0.3), 0.3, 0.1, np.float32(0.1)])
def test_the_ends_of_the_range_belong_to_it_as_float32(depth):
    said = {"depth_min_m": "0.1", "depth_max_m": "0.3", "depth_m": "0.2"}
    family = tiny_family(said, changes={"depth_m": np.float32(0.2)})
    assert texts(at_depth(family, depth))["deepmuon.depth_m"] in ("0.1", "0.3")


@pytest.mark.parametrize("depth", [-0.1, 100.1, float("nan"), float("inf"), -1e300, 1e300])
def test_a_depth_outside_is_refused_with_the_range(depth):
    assert refusal(tiny_family(), depth).endswith("in family.onnx: there are those from 0 to 100 m")


@pytest.mark.parametrize("depth", ["10", None, [10], 10j, True])
def test_a_depth_that_is_no_number_is_refused(depth):
    assert "is no number" in refusal(tiny_family(), depth)


def test_a_model_of_one_depth_takes_no_other():
    assert "is no family: all its muons are of 10 m" in refusal(tiny_model(), 20)
    assert "is no family" in refusal(tiny_model(), 10)


def test_a_surface_that_there_is_not_is_refused():
    assert "no surface 2" in refusal(tiny_family(), 10, 2)
    assert "no tables of a sphere's flux" in refusal(tiny_family(has_sphere=False), 10, 1)
    assert at_depth(tiny_family(has_sphere=False), 20)


@pytest.mark.parametrize(
    ("metadata", "reason"),
    [
        ({"depth_min_m": "100", "depth_max_m": "0"}, "depth_min_m, 100, is not below depth_max_m, 0"),
        ({"depth_min_m": "10", "depth_max_m": "10"}, "a family needs two depths or more"),
        ({"depth_min_m": None}, "go together, and one is missing"),
        ({"depth_max_m": None}, "go together, and one is missing"),
        ({"depth_min_m": "-1"}, "depth_min_m is '-1', and should be a number from 0 to 3.4"),
        ({"depth_max_m": "inf"}, "depth_max_m is 'inf'"),
        ({"depth_max_m": "1e39"}, "depth_max_m is '1e39'"),
        ({"depth_max_m": "nan"}, "depth_max_m is 'nan'"),
        ({"depth_m": "101"}, "depth_m is 101, and should be from 0 to 100"),
        ({"depth_m": "nan"}, "depth_m is 'nan'"),
        ({"depth_m": "20"}, "initializer depth_m is 10, and its metadata says 20"),
        ({"surface": "1"}, "initializer surface is 0, and its metadata says 1"),
        ({"surface": "2"}, "surface is '2', and should be 0, a horizontal plane, or 1, a sphere"),
        ({"rate_hz_per_m2": "55"}, "the rate of a family goes with the depth"),
        ({"rate_relative_uncertainty": "-1"}, "rate_relative_uncertainty is '-1'"),
    ],
)
def test_a_family_that_says_what_can_not_be_is_refused_in_one_line(tmp_path: Path, metadata: dict, reason: str):
    contents = tiny_family(metadata)
    assert reason in refusal(contents)
    path = tmp_path / "family.onnx"
    path.write_bytes(contents)
    with pytest.raises(RefusedError, match="breaks the contract"):
        Generator.open(file=path)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"depth_m": None}, "has no initializer depth_m"),
        ({"depth_m": np.float64(10)}, "initializer depth_m should be a scalar of type float32"),
        ({"depth_m": np.float32([10])}, "initializer depth_m should be a scalar of type float32"),
        ({"depth_m": np.float32(20)}, "initializer depth_m is 20, and its metadata says 10"),
        ({"depth_m": np.float32("nan")}, "initializer depth_m is nan"),
        ({"surface": np.int64(0)}, "initializer surface should be a scalar of type int32"),
        ({"surface": np.int32(2)}, "initializer surface is 2, and its metadata says 0"),
    ],
)
@pytest.mark.parametrize("raw", [True, False])
def test_a_family_with_another_number_in_it_is_refused(changes: dict, reason: str, raw: bool):
    assert reason in refusal(tiny_family(changes=changes, raw=raw))


def test_two_initializers_of_one_name_are_refused():
    model = onnx.load_from_string(tiny_family())
    model.graph.initializer.append(numpy_helper.from_array(np.float32(10), "depth_m"))
    assert "two initializers depth_m" in refusal(model.SerializeToString())


def test_a_number_that_is_stored_twice_or_not_at_all_is_refused():
    model = onnx.load_from_string(tiny_family())
    (tensor,) = (tensor for tensor in model.graph.initializer if tensor.name == "depth_m")
    tensor.float_data.append(10)
    assert "depth_m should hold one number" in refusal(model.SerializeToString())
    tensor.ClearField("raw_data")
    tensor.ClearField("float_data")
    assert "depth_m should hold one number" in refusal(model.SerializeToString())


@pytest.mark.parametrize("rate", [0, -1, float("nan"), float("inf")])
def test_a_rate_that_is_not_positive_is_refused(tmp_path: Path, rate: float):
    path = tmp_path / "family.onnx"
    path.write_bytes(tiny_family(changes={"maps/rate": np.full((2, 3, 1), rate, np.float32)}))
    with pytest.raises(RefusedError, match=r"its rate at 10 m is .*, and should be positive") as refused:
        Generator.open(file=path)
    assert "\n" not in str(refused.value)


@settings(deadline=None)
@given(
    number=st.integers(0, len(DAMAGES) - 1),
    seed=st.integers(0, 2**32 - 1),
    depth=st.floats(),
    surface=st.integers(-1, 2),
)
def test_a_damaged_family_is_refused_or_has_the_depth(number: int, seed: int, depth: float, surface: int):
    damaged = DAMAGES[number](tiny_family(), np.random.default_rng(seed))
    with contextlib.suppress(RefusedError):
        at_depth(at_depth(damaged, depth, surface), depth, surface)


@given(st.binary(max_size=200))
def test_any_bytes_are_no_family(contents: bytes):
    refusal(contents)
