"""Writes ONNX graphs node by node."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

__all__ = ["IR_VERSION", "OPSET", "RATE", "Graph"]

OPSET = 20
"""The newest operator set that ONNX Runtime 1.17 reads."""

IR_VERSION = 9
"""Likewise, of the file format."""

RATE = "rate/value"
"""What the output of the rate is a copy of: a constant, or a value of the depth."""


class Graph:
    """A graph under construction; a value is known by its name, a string.

    Calling the graph adds a node: ``y = graph("Mul", x, 2.0)``. Numbers and arrays become constants, numbers as
    float32. Names are counted, so that the same calls give the same bytes. Every node has a name of its own: ONNX
    Runtime 1.19 to 1.21 refuse graphs in which they fuse nodes without names. What a node is for is said before
    its operator: ``with graph.scope("energy"):`` gives ``energy/Mul_7``.

    Attributes
    ----------
    nodes : list of onnx.NodeProto
        What was added, in order.
    initializers : list of onnx.TensorProto
        The constants, in order of their first use.
    """

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.initializers: list[onnx.TensorProto] = []
        self._constants: dict[tuple[str, tuple[int, ...], bytes], str] = {}
        self._scope = ""

    @contextmanager
    def scope(self, name: str) -> Iterator[None]:
        """Let the names of the nodes that are added begin with this, and a slash; scopes may be nested."""
        outer, self._scope = self._scope, f"{self._scope}{name}/"
        try:
            yield
        finally:
            self._scope = outer

    def __call__(self, operator: str, *inputs: str | float | NDArray[Any], **attributes: Any) -> str:
        """Add a node of one output and return the output's name."""
        return self.several(operator, 1, *inputs, **attributes)[0]

    def several(self, operator: str, outputs: int, *inputs: str | float | NDArray[Any], **attributes: Any) -> list[str]:
        """Add a node of several outputs and return their names."""
        name = f"{operator}_{len(self.nodes)}"
        names = [f"{name}_{k}" for k in range(outputs)] if outputs > 1 else [name]
        sources = [value if isinstance(value, str) else self.constant(value) for value in inputs]
        self.nodes.append(helper.make_node(operator, sources, names, name=self._scope + name, **attributes))
        return names

    def constant(self, value: float | NDArray[Any], name: str | None = None) -> str:
        """Return the name of a constant; equal ones are stored once, under the name that the first was given."""
        array = np.asarray(value, dtype=np.float32) if isinstance(value, float | int) else np.asarray(value)
        key = array.dtype.str, array.shape, array.tobytes()
        if key not in self._constants:
            self._constants[key] = name or f"constant_{len(self._constants)}"
            self.initializers.append(numpy_helper.from_array(array, self._constants[key]))
        return self._constants[key]

    def changeable(self, value: NDArray[Any], name: str) -> str:
        """Return the name of a constant that is stored by itself, so that it can be changed in the file."""
        self.initializers.append(numpy_helper.from_array(value, name))
        return name

    def named(self, value: str, name: str) -> str:
        """Give the value of a node that nothing uses yet another name, and return that."""
        (node,) = (node for node in self.nodes if value in node.output)
        node.output[list(node.output).index(value)] = name
        return name

    def model(
        self,
        inputs: Mapping[str, list[str | int]],
        outputs: Mapping[str, tuple[str, int, list[str | int]]],
        metadata: Mapping[str, str],
    ) -> onnx.ModelProto:
        """Finish the graph and return it as a checked model.

        Parameters
        ----------
        inputs
            Shape of each float32 input, by name.
        outputs
            For each output, by name: the value it takes, its element type and its shape.
        metadata
            Written as metadata_props, in order.

        Raises
        ------
        onnx.checker.ValidationError, onnx.shape_inference.InferenceError
            If it is no valid model, or its types and shapes do not fit together.
        """
        for name, (value, _, _) in outputs.items():
            self.nodes.append(helper.make_node("Identity", [value], [name], name=f"output/{name}"))
        graph = helper.make_graph(
            self.nodes,
            "deepmuon",
            [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in inputs.items()],
            [helper.make_tensor_value_info(name, kind, shape) for name, (_, kind, shape) in outputs.items()],
            self.initializers,
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
        model.producer_name = "deepmuon"
        helper.set_model_props(model, dict(metadata))
        onnx.checker.check_model(model, full_check=True)
        return model
