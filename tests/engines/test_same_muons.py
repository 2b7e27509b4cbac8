"""One set of latents, one set of muons, in every engine."""

from __future__ import annotations

import os
from pathlib import Path

import onnx
import pytest
from support.engines import ENGINES, MODELS, TOLERANCE, Engine, difference, expected

NEEDED = os.environ.get("DEEPMUON_ENGINES", "").split(",")
"""Names of packages without which a test fails instead of being skipped."""


@pytest.fixture(params=MODELS, ids=lambda path: path.stem)
def model(request: pytest.FixtureRequest) -> Path:
    return request.param


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Engine:
    engine = ENGINES[request.param]
    if engine.missing() and engine.package not in NEEDED:
        pytest.skip(engine.missing())
    return engine


def test_every_engine_gives_the_muons_that_pytorch_makes(engine: Engine, model: Path):
    right = expected(model)
    found = engine.run(model)
    assert [column.shape for column in found] == [column.shape for column in right]
    seen = difference(found, right)
    assert seen.energy <= TOLERANCE.energy
    assert seen.direction <= TOLERANCE.direction
    assert seen.charges <= TOLERANCE.charges


def test_one_other_muon_is_seen(model: Path):
    right = expected(model)
    energy, direction, charge = (column.copy() for column in right)
    energy[-1] *= 1 + 3e-5
    direction[-1, 2] += 3e-6
    charge[-1] *= -1
    assert difference(right, right) == (0, 0, 0)
    assert difference(right._replace(kinetic_energy=energy), right).energy > TOLERANCE.energy
    assert difference(right._replace(direction=direction), right).direction > TOLERANCE.direction
    assert difference(right._replace(charge=charge), right).charges > TOLERANCE.charges


def test_types_and_shapes_follow_from_the_graph_alone(model: Path):
    proto = onnx.load(model)
    onnx.checker.check_model(proto, full_check=True)
    outputs = list(proto.graph.output)
    del proto.graph.output[:], proto.graph.value_info[:]
    proto.graph.output.extend(onnx.helper.make_empty_tensor_value_info(output.name) for output in outputs)
    inferred = onnx.shape_inference.infer_shapes(proto, check_type=True, strict_mode=True, data_prop=True)
    for found, declared in zip(inferred.graph.output, outputs, strict=True):
        assert found.type.tensor_type.elem_type == declared.type.tensor_type.elem_type
        assert len(found.type.tensor_type.shape.dim) == len(declared.type.tensor_type.shape.dim)


def test_only_operators_of_the_standard_domain_are_used(model: Path):
    proto = onnx.load(model)
    assert {opset.domain for opset in proto.opset_import} == {node.domain for node in proto.graph.node} == {""}
    assert not proto.functions
