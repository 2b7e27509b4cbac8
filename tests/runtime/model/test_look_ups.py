from __future__ import annotations

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from deepmuon_runtime.model.device import open_session
from deepmuon_runtime.model.look_ups import with_gather

TABLE = np.arange(300, dtype=np.float32) ** 2


def model(*names: str) -> bytes:
    """Return a model that looks the same indices up by a node of each name."""
    nodes = [
        helper.make_node("GatherElements", ["table", "index"], [f"y{k}"], name=name, axis=0)
        for k, name in enumerate(names)
    ]
    graph = helper.make_graph(
        nodes,
        "look-ups",
        [helper.make_tensor_value_info("index", TensorProto.INT32, ["n"])],
        [helper.make_tensor_value_info(f"y{k}", TensorProto.FLOAT, ["n"]) for k in range(len(nodes))],
        [numpy_helper.from_array(TABLE, "table")],
    )
    proto = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 20)], ir_version=9)
    helper.set_model_props(proto, {"a": "b"})
    return proto.SerializeToString()


def operators(content: bytes) -> list[str]:
    return [node.op_type for node in onnx.load_from_string(content).graph.node]


def test_look_ups_are_done_by_gather_and_give_the_same_numbers_of_negative_indices_too():
    content = with_gather(model("energy/look_up/GatherElements_0"))
    assert operators(content) == ["Gather"]
    index = np.array([0, 299, -1, -300, 7], dtype=np.int32)
    (found,) = onnxruntime.InferenceSession(content).run(None, {"index": index})
    np.testing.assert_array_equal(found, TABLE[index])


def test_nothing_else_is_changed():
    content = model("energy/look_up/GatherElements_0", "of another kind")
    changed = with_gather(content)
    assert operators(changed) == ["Gather", "GatherElements"]
    proto = onnx.load_from_string(changed)
    proto.graph.node[0].op_type = "GatherElements"
    assert proto == onnx.load_from_string(content)


def test_a_model_without_look_ups_stays_as_it_is_byte_by_byte():
    content = model("some", "others")
    assert with_gather(content) == content


def test_what_is_no_message_is_an_error():
    with pytest.raises(ValueError, match="cut off"):
        with_gather(model("a")[:-3])


def test_cuda_is_given_gather_and_a_processor_gather_elements(monkeypatch):
    content, given = model("energy/look_up/GatherElements_0"), []

    class Session:
        def __init__(self, content, options, providers, **others):
            self._provider = providers[0][0]
            given.append((self._provider, operators(content)))

        def get_providers(self):
            return [self._provider]

    monkeypatch.setattr(onnxruntime, "InferenceSession", Session)
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: ["CUDAExecutionProvider"])
    assert open_session(content, "a model", "cuda")[1] == "cuda"
    assert open_session(content, "a model", "cpu")[1] == "cpu"
    assert given == [("CUDAExecutionProvider", ["Gather"]), ("CPUExecutionProvider", ["GatherElements"])]
