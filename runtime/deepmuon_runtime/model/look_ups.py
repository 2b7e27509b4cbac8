"""The look-ups of a model, by the operator that the device does fastest.

Of data and indices of one dimension, along axis 0, GatherElements and Gather are the same operation. ONNX Runtime does
the first ten times as fast on a processor, and the second five times as fast on CUDA. Files hold the first; where
a node's name has `/look_up/` in it, it is sure that data and indices have one dimension.

The file is changed as the Protocol Buffers message that it is, without the onnx package. Source of the field numbers:
https://github.com/onnx/onnx/blob/main/onnx/onnx.proto
"""

from __future__ import annotations

from deepmuon_runtime.model.protobuf import fields, with_changed

__all__ = ["with_gather"]

GRAPH_OF_MODEL, NODE_OF_GRAPH = 7, 1
NAME_OF_NODE, OPERATOR_OF_NODE = 3, 4

LOOK_UP = b"/look_up/"


def with_gather(content: bytes) -> bytes:
    """Return a model with Gather in place of GatherElements in its look-ups; all else stays, byte for byte.

    Parameters
    ----------
    content
        An ONNX file.

    Raises
    ------
    ValueError
        If it is no message of Protocol Buffers.
    """
    return with_changed(memoryview(content), GRAPH_OF_MODEL, _graph_with_gather)


def _graph_with_gather(graph: memoryview) -> bytes:
    return with_changed(graph, NODE_OF_GRAPH, _node_with_gather)


def _node_with_gather(node: memoryview) -> bytes:
    found = {number: bytes(value) for number, value in fields(node) if isinstance(value, memoryview)}
    if found.get(OPERATOR_OF_NODE) != b"GatherElements" or LOOK_UP not in found.get(NAME_OF_NODE, b""):
        return bytes(node)
    return with_changed(node, OPERATOR_OF_NODE, lambda _: b"Gather")
