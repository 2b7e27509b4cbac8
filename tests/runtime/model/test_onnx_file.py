from __future__ import annotations

import contextlib
from collections.abc import Callable

import onnx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from onnx import ModelProto, TensorProto, helper
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, RefusedError, list_models
from deepmuon_runtime.model.onnx_file import check_onnx_file
from deepmuon_runtime.model.released import read_released

Edit = Callable[[ModelProto], object]


def changed(edit: Edit) -> bytes:
    model = onnx.load_from_string(tiny_model())
    edit(model)
    return bytes(model.SerializeToString())


def if_node(*nodes: onnx.NodeProto) -> onnx.NodeProto:
    branch = helper.make_graph(list(nodes), "branch", [], [])
    return helper.make_node("If", ["c"], ["y"], then_branch=branch, else_branch=branch)


def external(tensor: TensorProto) -> TensorProto:
    tensor.external_data.add(key="location", value="../../etc/passwd")
    return tensor


def located(tensor: TensorProto) -> TensorProto:
    tensor.data_location = TensorProto.EXTERNAL
    return tensor


def tensor(name: str = "t") -> TensorProto:
    return helper.make_tensor(name, TensorProto.FLOAT, [1], [1.0])


def indices() -> TensorProto:
    return helper.make_tensor("i", TensorProto.INT64, [1], [0])


def nested(depth: int) -> onnx.NodeProto:
    return if_node(nested(depth - 1)) if depth else helper.make_node("Add", ["a", "b"], ["c"])


def add_node(node: onnx.NodeProto) -> Edit:
    return lambda model: model.graph.node.append(node)


def constant(**attribute: object) -> onnx.NodeProto:
    return helper.make_node("Constant", [], ["k"], **attribute)


def set_opset(version: int) -> Edit:
    return lambda model: setattr(model.opset_import[0], "version", version)


def function(model: ModelProto) -> None:
    model.functions.append(
        helper.make_function("own", "F", ["x"], ["y"], [helper.make_node("Add", ["x", "x"], ["y"])], [])
    )


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (lambda model: setattr(model, "ir_version", 10), "its IR version is 10, and should be 9 at most"),
        (lambda model: setattr(model, "ir_version", -1), "its IR version is 18446744073709551615"),
        (set_opset(21), "its opset is 21, and should be 20 at most"),
        (set_opset(-1), "its opset is 18446744073709551615"),
        (lambda model: model.opset_import.add(domain="com.microsoft", version=1), "of the domain 'com.microsoft'"),
        (lambda model: model.opset_import.add(domain="\x1b[2J\n", version=1), r"of the domain '\x1b[2J\n'"),
        (function, "it has functions"),
        (lambda model: model.training_info.add(), "says how it is to be trained"),
        (add_node(helper.make_node("Gelu", ["a"], ["b"], domain="com.microsoft")), "of the domain 'com.microsoft'"),
        (add_node(helper.make_node("RandomUniform", [], ["r"], shape=[1])), "RandomUniform draws random numbers"),
        (add_node(helper.make_node("Multinomial", ["a"], ["r"])), "Multinomial draws random numbers"),
        (add_node(if_node(helper.make_node("Bernoulli", ["a"], ["r"]))), "Bernoulli draws random numbers"),
        (add_node(helper.make_node("Loop", ["m", "c"], ["y"])), "Loop could go on for ever"),
        (add_node(if_node(helper.make_node("Scan", ["m"], ["y"]))), "Scan could go on for ever"),
        (add_node(nested(12)), "nested without reason"),
        (add_node(helper.make_node("Split", ["a"], ["b"], num_outputs=2**31)), "of an operator is 2147483648"),
        (lambda model: external(model.graph.initializer[0]), "keeps numbers in another file"),
        (lambda model: located(model.graph.initializer[0]), "keeps numbers in another file"),
        (add_node(constant(value=external(tensor()))), "keeps numbers in another file"),
        (add_node(if_node(constant(value=located(tensor())))), "keeps numbers in another file"),
        (
            lambda model: model.graph.sparse_initializer.append(
                helper.make_sparse_tensor(external(tensor()), indices(), [3])
            ),
            "keeps numbers in another file",
        ),
        (
            add_node(constant(sparse_value=helper.make_sparse_tensor(tensor(), located(indices()), [3]))),
            "keeps numbers in another file",
        ),
        (lambda model: model.graph.node.extend([onnx.NodeProto()] * 1_000_001), "has more than 1000000 parts"),
    ],
)  # fmt: skip
def test_what_a_model_may_not_have_is_refused_in_one_line_before_it_is_loaded(tmp_path, monkeypatch, edit, reason):
    path = tmp_path / "model.onnx"
    path.write_bytes(changed(edit))
    monkeypatch.delattr("onnxruntime.InferenceSession")
    with pytest.raises(RefusedError, match=r"model\.onnx breaks the contract: ") as refused:
        Generator.open(file=path)
    assert reason in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "edit",
    [
        lambda model: None,
        lambda model: model.opset_import.add(domain="ai.onnx", version=20),
        add_node(if_node(constant(value=tensor()))),
        add_node(nested(3)),
        add_node(helper.make_node("Add", ["Loop", "RandomUniform"], ["external"], name="Loop", doc_string="Loop")),
    ],
)
def test_what_a_model_may_have_passes(edit):
    check_onnx_file(changed(edit), "model.onnx")


def test_every_released_model_passes():
    for model in list_models():
        check_onnx_file(read_released(model), model.name)


@pytest.mark.parametrize("twice", [1, 2])
def test_a_second_graph_is_looked_through_like_the_first(twice):
    """Protocol Buffers joins two messages in one field to a single one."""
    bad = onnx.ModelProto()
    bad.graph.node.append(helper.make_node("Loop", ["m", "c"], ["y"]))
    parts = [tiny_model(), bytes(bad.SerializeToString())]
    with pytest.raises(RefusedError, match="Loop"):
        check_onnx_file(b"".join(parts if twice == 1 else parts[::-1]), "model.onnx")


@given(st.binary(max_size=200))
def test_any_bytes_pass_or_are_refused(content):
    with contextlib.suppress(RefusedError):
        check_onnx_file(content, "model.onnx")
