from __future__ import annotations

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto

from deepmuon_training.export.graph import IR_VERSION, OPSET, Graph


def affine() -> tuple[Graph, str]:
    g = Graph()
    return g, g("Add", g("Mul", "x", 2.0), 1.0)


def finished(graph: Graph, value: str, kind: int = TensorProto.FLOAT) -> onnx.ModelProto:
    return graph.model({"x": ["n"]}, {"y": (value, kind, ["n"])}, {"b": "1", "a": "2"})


def run(model: onnx.ModelProto, x: np.ndarray) -> np.ndarray:
    return onnxruntime.InferenceSession(model.SerializeToString()).run(None, {"x": x})[0]


def test_a_graph_computes_what_was_written():
    x = np.array([0.5, -3.0], dtype=np.float32)
    np.testing.assert_array_equal(run(finished(*affine()), x), 2 * x + 1)


def test_the_same_calls_give_the_same_bytes():
    first, again = (finished(*affine()).SerializeToString(deterministic=True) for _ in range(2))
    assert first == again


def test_a_node_of_several_outputs_gives_them_all():
    g = Graph()
    low, high = g.several("Split", 2, "x", axis=0, num_outputs=2)
    np.testing.assert_array_equal(run(finished(g, g("Sub", high, low)), np.array([1, 5], dtype=np.float32)), [4])


def test_nodes_are_named_by_what_they_are_for():
    g = Graph()
    with g.scope("energy"):
        first = g("Mul", "x", 2.0)
        with g.scope("look_up"):
            second = g("Mul", first, 2.0)
    assert finished(g, g("Add", second, 1.0)).graph.node[-1].name == "output/y"
    assert [node.name for node in g.nodes] == ["energy/Mul_0", "energy/look_up/Mul_1", "Add_2", "output/y"]


def test_a_constant_has_the_name_that_it_was_given_first():
    g = Graph()
    assert g.constant(np.ones(3), "table") == g.constant(np.ones(3)) == "table"


def test_equal_constants_are_stored_once_and_different_ones_apart():
    g = Graph()
    assert g.constant(1.0) == g.constant(1) == g.constant(np.float32(1))
    others = [
        2.0,
        np.array([1.0], np.float32),
        np.array(1, np.int64),
        np.array(1.0, np.float64),
        np.array(1.0, np.float16),
    ]
    names = [g.constant(value) for value in (1.0, *others)]
    assert len(set(names)) == 6


def test_numbers_are_stored_as_float32():
    g, value = affine()
    assert {i.data_type for i in finished(g, value).graph.initializer} == {TensorProto.FLOAT}


def test_a_model_says_its_versions_and_metadata_in_order():
    model = finished(*affine())
    assert (model.ir_version, IR_VERSION) == (9, 9)
    assert [(entry.domain, entry.version) for entry in model.opset_import] == [("", OPSET)]
    assert OPSET == 20
    assert [(p.key, p.value) for p in model.metadata_props] == [("b", "1"), ("a", "2")]


def test_a_graph_of_an_unknown_operator_is_an_error():
    g = Graph()
    with pytest.raises(onnx.checker.ValidationError):
        finished(g, g("Sinus", "x"))


def test_an_output_of_another_type_is_an_error():
    with pytest.raises(onnx.shape_inference.InferenceError):
        finished(*affine(), kind=TensorProto.INT8)
