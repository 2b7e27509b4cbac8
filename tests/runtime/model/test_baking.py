"""A model of one depth from a family."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper
from support.analytic_family import analytic_family
from support.damage import DAMAGES
from support.tiny_families import tiny_family, tiny_tables

from deepmuon_runtime import Box, Generator, RefusedError
from deepmuon_runtime.model.baking import bake
from deepmuon_runtime.model.family import at_depth
from deepmuon_runtime.model.opening import checked_model, load_model

DEPTHS = [0, 13.7, 50, 100]


def opened(folder: Path, contents: bytes, depth: float | None = None) -> Generator:
    path = folder / "model.onnx"
    path.write_bytes(contents)
    return Generator.open(depth, file=path)


@pytest.mark.parametrize("depth", DEPTHS)
def test_a_baked_model_gives_the_muons_of_its_family_bit_by_bit(tmp_path: Path, depth: float):
    family, baked = opened(tmp_path, tiny_family(), depth), opened(tmp_path, bake(tiny_family(), depth))
    one, two = family.sample(20_000, seed=1), baked.sample(20_000, seed=1)
    for name, column in one.columns.items():
        np.testing.assert_array_equal(column, getattr(two, name))
    assert family.number_in_live_time(3600, 4, seed=2) == baked.number_in_live_time(3600, 4, seed=2)


def test_its_metadata_are_those_of_a_model_of_one_depth(tmp_path: Path):
    family = opened(tmp_path, tiny_family(), 13.7).model
    baked = opened(tmp_path, bake(tiny_family(), 13.7)).model
    assert not baked.is_family
    for name in ("depth_m", "surface", "medium", "flux", "stream", "rate_hz_per_m2", "rate_uncertainty_hz_per_m2"):
        assert getattr(baked, name) == getattr(family, name)
    assert baked.metadata["baked_from"] == family.sha256
    assert baked.sha256 != family.sha256


def test_it_holds_the_coarse_tables_and_nothing_of_the_depth():
    model = onnx.load_from_string(bake(tiny_family(), 13.7))
    onnx.checker.check_model(model, full_check=True)
    assert not [node.name for node in model.graph.node if node.name.startswith("depth/")]
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    names = ["energy/table", "zenith/table", "charge/table"]
    for name, expected in zip(names, tiny_tables(13.7), strict=True):
        np.testing.assert_allclose(stored[name], expected, rtol=1e-6)
    assert not stored.keys() & {"depth_m", "surface", "knots", "spacing", "maps/energy"}
    used = {name for node in model.graph.node for name in node.input}
    assert stored.keys() <= used


def test_its_bytes_are_the_same_each_time_and_from_whatever_depth_the_family_had():
    assert bake(tiny_family(), 13.7) == bake(tiny_family(), 13.7)
    parts = [onnx.load_from_string(bake(family, 13.7)) for family in (tiny_family(), at_depth(tiny_family(), 80))]
    assert parts[0].graph == parts[1].graph


def test_a_sphere_is_baked_too(tmp_path: Path):
    model = opened(tmp_path, bake(tiny_family(), 13.7, 1)).model
    assert (model.surface, model.metadata["surface"]) == (1, "1")
    assert model.rate_hz_per_m2 == pytest.approx(112.736, rel=1e-4)  # between 150 and 14 at 27.4 %


def left_after_loading(contents: bytes, folder: Path) -> list[tuple[str, ...]]:
    """Return the operators that ONNX Runtime runs, with the numbers of their inputs."""
    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(folder / "optimized.onnx")
    options.log_severity_level = 4
    onnxruntime.InferenceSession(contents, options, providers=["CPUExecutionProvider"])
    graph = onnx.load(folder / "optimized.onnx").graph
    return sorted((node.op_type, str(len(node.input))) for node in graph.node)


@pytest.mark.parametrize("depth", DEPTHS)
def test_nothing_of_the_depth_is_left_in_what_onnx_runtime_runs(tmp_path: Path, depth: float):
    family = left_after_loading(at_depth(tiny_family(), depth), tmp_path)
    baked = left_after_loading(bake(tiny_family(), depth), tmp_path)
    assert family == baked
    assert not {"MatMul", "Abs", "Relu", "Div", "Reshape"} & {operator for operator, _ in family}


def test_a_model_of_one_depth_can_not_be_baked():
    with pytest.raises(RefusedError, match="is no family"):
        bake(bake(tiny_family(), 10), 10)


def test_a_depth_that_goes_with_the_latents_is_refused_in_one_line():
    model = onnx.load_from_string(tiny_family())
    model.graph.node.insert(0, helper.make_node("ReduceMax", ["latent"], ["largest"], keepdims=0, name="latent/max"))
    (hat,) = (node for node in model.graph.node if node.output[0] == "depth/hat")
    model.graph.node.insert(1, helper.make_node("Add", ["largest", "one"], ["above"], name="latent/above"))
    hat.input[0] = "above"
    with pytest.raises(RefusedError, match=r"can't be baked|no ONNX model that can be run") as refused:
        bake(model.SerializeToString(), 10)
    assert "\n" not in str(refused.value)


def test_a_family_whose_nodes_of_the_depth_are_not_named_so_is_refused_in_one_line():
    model = onnx.load_from_string(analytic_family())
    for node in model.graph.node:
        node.name = node.name.removeprefix("depth/")
    with pytest.raises(RefusedError, match=r"can't be baked: no node .* has a name that begins with depth/") as refused:
        bake(model.SerializeToString(), 10)
    assert "\n" not in str(refused.value)


def test_a_body_takes_the_muons_of_a_family_baked_for_a_sphere(tmp_path: Path):
    family, baked = opened(tmp_path, analytic_family(), 10), opened(tmp_path, bake(analytic_family(), 10, 1))
    box = Box(0.4, 0.4, 0.3)
    assert baked.rate(target=box) == family.rate(target=box)
    one, two = (generator.sample(20_000, seed=1, target=box) for generator in (family, baked))
    for name, column in one.columns.items():
        np.testing.assert_array_equal(column, two.columns[name])


def test_tables_of_another_type_are_refused():
    model = onnx.load_from_string(tiny_family())
    (end,) = (node for node in model.graph.node if node.output[0] == "charge/table")
    end.output[0] = "depth/threshold"
    wide = helper.make_node("Cast", ["depth/threshold"], ["charge/table"], name="depth/Cast", to=TensorProto.DOUBLE)
    back = helper.make_node("Cast", ["charge/table"], ["charge/narrow"], name="charge/Cast", to=TensorProto.FLOAT)
    at = list(model.graph.node).index(end) + 1
    model.graph.node.insert(at, wide)
    model.graph.node.insert(at + 1, back)
    (greater,) = (node for node in model.graph.node if node.op_type == "Greater")
    greater.input[1] = "charge/narrow"
    with pytest.raises(RefusedError, match=r"its charge/table is of type float64"):
        bake(model.SerializeToString(), 10)


@settings(max_examples=50, deadline=None)
@given(number=st.integers(0, len(DAMAGES) - 1), seed=st.integers(0, 2**32 - 1))
def test_a_damaged_family_is_refused_or_baked_to_a_model_that_keeps_the_contract(number: int, seed: int):
    """A model that does not is refused by `bake` itself."""
    damaged = DAMAGES[number](tiny_family(), np.random.default_rng(seed))
    with contextlib.suppress(RefusedError):
        assert load_model(*checked_model(bake(damaged, 10), "baked"), "cpu")[1].depth_m == 10
