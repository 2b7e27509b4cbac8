"""A model of one depth from a family: smaller, for embedding, and without what makes the depth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError, first_line
from deepmuon_runtime.model.device import open_session
from deepmuon_runtime.model.family import with_metadata
from deepmuon_runtime.model.metadata import HORIZONTAL_PLANE
from deepmuon_runtime.model.opening import checked_model, load_model
from deepmuon_runtime.model.protobuf import field, parts, varint_field, with_changed

__all__ = ["bake"]

GRAPH_OF_MODEL = 7
NODE_OF_GRAPH, INITIALIZER_OF_GRAPH, INPUT_OF_GRAPH, OUTPUT_OF_GRAPH, VALUE_INFO_OF_GRAPH = 1, 5, 11, 12, 13
INPUT_OF_NODE, OUTPUT_OF_NODE, NAME_OF_NODE, OPERATOR_OF_NODE, ATTRIBUTE_OF_NODE = 1, 2, 3, 4, 5
GRAPHS_OF_ATTRIBUTE = (6, 11)
NAME_OF_VALUE = 1
DIMENSION, TYPE, NAME_OF_TENSOR, RAW_DATA = 1, 2, 8, 9
TYPES = {np.dtype(np.float32): 1, np.dtype(np.int32): 6, np.dtype(np.int64): 7}

DEPTH = "depth/"
"""Begins the names of the nodes that make the tables of a depth."""


def bake(contents: bytes, depth_m: float, surface: int = HORIZONTAL_PLANE, name: str = "the model") -> bytes:
    """Return the model of one depth that a family holds: its tables in place of the nodes that make them.

    It gives the family's muons at that depth, and the same bytes each time, on one type of CPU.

    Parameters
    ----------
    contents, depth_m, surface, name
        As for `deepmuon_runtime.model.family.at_depth`.

    Raises
    ------
    RefusedError
        As `checked_model` and `load_model`, or if the nodes whose names begin with `depth/` need latents,
        make other than float32, int32 or int64, or are not there.
    """
    placed, family = checked_model(contents, name, depth_m, surface)
    _, model, _ = load_model(placed, family, "cpu")
    rate, uncertainty = model.rate_hz_per_m2, model.rate_uncertainty_hz_per_m2
    said = {
        "depth_min_m": None,
        "depth_max_m": None,
        "knots_m": None,
        "surface": str(model.surface),
        "rate_hz_per_m2": None if rate is None else repr(rate),
        "rate_uncertainty_hz_per_m2": None if uncertainty is None else repr(uncertainty),
        "baked_from": family.sha256,
    }

    def baked(graph: memoryview) -> bytes:
        return _baked(graph, placed, name)

    try:
        fixed = with_metadata(with_changed(memoryview(placed), GRAPH_OF_MODEL, baked), said)
    except UnicodeDecodeError as error:
        raise RefusedError(f"{name} can't be baked: the name of a node is no text in UTF-8") from error
    load_model(*checked_model(fixed, name), "cpu")
    return fixed


@dataclass(frozen=True)
class _Node:
    """A node and the names around it; of graphs inside, the names that they take too."""

    whole: memoryview
    name: str
    inputs: frozenset[str]
    outputs: tuple[str, ...]


def _baked(graph: memoryview, model: bytes, name: str) -> bytes:
    """Return a graph whose nodes of the depth are replaced by what they make."""
    nodes = [_node(value, whole) for number, value, whole in _messages(graph) if number == NODE_OF_GRAPH]
    outputs = [_name(value, NAME_OF_VALUE) for number, value, _ in _messages(graph) if number == OUTPUT_OF_GRAPH]
    kept = [node for node in nodes if not node.name.startswith(DEPTH)]
    needed = set(outputs).union(*(node.inputs for node in kept))
    made = [output for node in nodes if node.name.startswith(DEPTH) for output in node.outputs]
    ends = [end for end in made if end in needed]
    if not ends:
        raise RefusedError(
            f"{name} can't be baked: no node that its muons or rate need has a name that begins with {DEPTH}"
        )
    values = dict(zip(ends, _run(graph, model, nodes, ends, name), strict=True))
    tables = [_tensor(_stored(end, outputs), value, name) for end, value in values.items()]
    given = [_identity(end) for end in ends if end in outputs]
    live = _live(kept, outputs)
    alive = [bytes(node.whole) for node in kept if live.intersection(node.outputs)]
    rest = [bytes(whole) for number, value, whole in _messages(graph) if _stays(number, value, live, values)]
    return b"".join(given + alive + rest + tables)


def _stays(number: int, value: memoryview, live: set[str], made: dict[str, Any]) -> bool:
    if number == NODE_OF_GRAPH:
        return False  # they stand before the rest
    if number == INITIALIZER_OF_GRAPH:
        return _name(value, NAME_OF_TENSOR) in live
    if number == VALUE_INFO_OF_GRAPH:
        return _name(value, NAME_OF_VALUE) in live and _name(value, NAME_OF_VALUE) not in made
    return True


def _run(graph: memoryview, model: bytes, nodes: list[_Node], ends: list[str], name: str) -> list[NDArray[Any]]:
    """Return what the nodes of the depth make: a model of them alone is run."""
    live = _live(nodes, ends)
    body = [bytes(node.whole) for node in nodes if live.intersection(node.outputs)]
    constants = [
        bytes(whole)
        for number, value, whole in _messages(graph)
        if number == INITIALIZER_OF_GRAPH and _name(value, NAME_OF_TENSOR) in live
    ]
    wanted = [field(OUTPUT_OF_GRAPH, field(NAME_OF_VALUE, end.encode())) for end in ends]
    alone = b"".join([*body, field(2, b"depth"), *constants, *wanted])
    session, _ = open_session(with_changed(memoryview(model), GRAPH_OF_MODEL, lambda _: alone), name, "cpu")
    try:
        return list(session.run(ends, {}))
    except Exception as error:  # ONNX Runtime's own classes have no common base
        raise RefusedError(f"{name} can't be baked: {first_line(error)}") from error


def _live(nodes: list[_Node], wanted: list[str]) -> set[str]:
    """Return the names that outputs need, themselves among them; nodes stand after those whose outputs they take."""
    live = set(wanted)
    for node in reversed(nodes):
        if live.intersection(node.outputs):
            live |= node.inputs
    return live


def _tensor(name: str, value: NDArray[Any], model: str) -> bytes:
    if value.dtype not in TYPES:
        raise RefusedError(f"{model} can't be baked: its {name} is of type {value.dtype}, and should be float32")
    dimensions = b"".join(varint_field(DIMENSION, size) for size in value.shape)
    kind = varint_field(TYPE, TYPES[value.dtype])
    raw = field(RAW_DATA, value.astype(value.dtype.newbyteorder("<")).tobytes())
    return field(INITIALIZER_OF_GRAPH, dimensions + kind + field(NAME_OF_TENSOR, name.encode()) + raw)


def _stored(end: str, outputs: list[str]) -> str:
    """Return the name of a table; an output of the graph is made of one, since not all engines give tables away."""
    return f"{end}/baked" if end in outputs else end


def _identity(output: str) -> bytes:
    texts = {
        INPUT_OF_NODE: f"{output}/baked",
        OUTPUT_OF_NODE: output,
        NAME_OF_NODE: f"{output}/Identity",
        OPERATOR_OF_NODE: "Identity",
    }
    return field(NODE_OF_GRAPH, b"".join(field(number, text.encode()) for number, text in texts.items()))


def _node(node: memoryview, whole: memoryview) -> _Node:
    outputs = tuple(str(value, "utf-8") for number, value, _ in _messages(node) if number == OUTPUT_OF_NODE)
    return _Node(whole, _name(node, NAME_OF_NODE), frozenset(_taken(node)), outputs)


def _taken(node: memoryview) -> Iterator[str]:
    for number, value, _ in _messages(node):
        if number == INPUT_OF_NODE:
            yield str(value, "utf-8")
        elif number == ATTRIBUTE_OF_NODE:
            for kind, graph, _ in _messages(value):
                if kind in GRAPHS_OF_ATTRIBUTE:
                    for part, inner, _ in _messages(graph):
                        if part == NODE_OF_GRAPH:
                            yield from _taken(inner)
                        elif part == OUTPUT_OF_GRAPH:
                            yield _name(inner, NAME_OF_VALUE)


def _name(message: memoryview, number: int) -> str:
    return "".join(str(value, "utf-8") for found, value, _ in _messages(message) if found == number)


def _messages(message: memoryview) -> Iterator[tuple[int, memoryview, memoryview]]:
    return ((number, value, whole) for number, value, whole in parts(message) if isinstance(value, memoryview))
