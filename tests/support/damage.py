"""Damaged files, the same ones each time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import onnx
from numpy.random import Generator
from onnx import ModelProto

__all__ = ["DAMAGES", "change_graph", "cut_out", "overwrite", "repeat", "truncate"]

OPERATORS = sorted(schema.name for schema in onnx.defs.get_all_schemas() if schema.domain == "")
NUMBERS = (-(2**63), -(2**31), -1, 0, 1, 2, 7, 10**6, 2**31, 2**40, 2**62, 2**63 - 1)


def overwrite(content: bytes, random: Generator) -> bytes:
    """Set 1 to 8 bytes to random ones."""
    copy = np.frombuffer(content, np.uint8).copy()
    hit = random.integers(len(copy), size=random.integers(1, 9))
    copy[hit] = random.integers(256, size=len(hit))
    return copy.tobytes()


def truncate(content: bytes, random: Generator) -> bytes:
    """Keep the beginning."""
    return content[: random.integers(len(content))]


def cut_out(content: bytes, random: Generator) -> bytes:
    """Take out up to 200 bytes."""
    first = random.integers(len(content))
    return content[:first] + content[first + random.integers(1, 201) :]


def repeat(content: bytes, random: Generator) -> bytes:
    """Give up to 200 bytes twice."""
    first = random.integers(len(content))
    return content[: first + random.integers(1, 201)] + content[first:]


def change_graph(content: bytes, random: Generator) -> bytes:
    """Change 1 to 3 operators, inputs, attributes, types, shapes or numbers of a model."""
    model = onnx.load_from_string(content)
    for _ in range(random.integers(1, 4)):
        _pick(random, GRAPH_CHANGES)(model, random)
    return bytes(model.SerializeToString())


DAMAGES = (overwrite, truncate, cut_out, repeat, change_graph, change_graph, change_graph)
"""What is done to models; the graph matters most: it gets past the first checks."""


def _pick(random: Generator, choices: Sequence[Any]) -> Any:
    return choices[random.integers(len(choices))]


def _change_operator(model: ModelProto, random: Generator) -> None:
    _pick(random, model.graph.node).op_type = _pick(random, OPERATORS)


def _change_input(model: ModelProto, random: Generator) -> None:
    names = [node.output[0] for node in model.graph.node] + [tensor.name for tensor in model.graph.initializer]
    node = _pick(random, model.graph.node)
    if node.input:
        node.input[random.integers(len(node.input))] = _pick(random, names)


def _change_attribute(model: ModelProto, random: Generator) -> None:
    attributes = [attribute for node in model.graph.node for attribute in node.attribute]
    if attributes:
        attribute = _pick(random, attributes)
        attribute.i = _pick(random, NUMBERS)
        attribute.ints[:] = [_pick(random, NUMBERS) for _ in attribute.ints]


def _change_type(model: ModelProto, random: Generator) -> None:
    _pick(random, model.graph.initializer).data_type = int(random.integers(24))


def _change_shape(model: ModelProto, random: Generator) -> None:
    dims = _pick(random, model.graph.initializer).dims
    dims[:] = [*dims[1:], _pick(random, NUMBERS)]


def _change_number(model: ModelProto, random: Generator) -> None:
    integers = [tensor for tensor in model.graph.initializer if tensor.data_type == onnx.TensorProto.INT64]
    if integers:
        tensor = _pick(random, integers)
        tensor.raw_data, tensor.int64_data[:] = _pick(random, NUMBERS).to_bytes(8, "little", signed=True), []


GRAPH_CHANGES: tuple[Callable[[ModelProto, Generator], None], ...] = (
    _change_operator,
    _change_input,
    _change_attribute,
    _change_type,
    _change_shape,
    _change_number,
)
