"""Whether a loaded model keeps the ONNX contract, version 2."""

from __future__ import annotations

from collections.abc import Sequence

import onnxruntime

from deepmuon_runtime.errors import RefusedError, shown
from deepmuon_runtime.model.metadata import Model

__all__ = ["INPUT", "OUTPUTS", "RATE", "check_signature"]

INPUT = "latent"
OUTPUTS = ("kinetic_energy", "direction", "charge")
RATE = "rate_hz_per_m2"
"""An output of models that know their rate, since version 2: it needs no latents."""

_Nodes = dict[str, tuple[str, list[str | int]]]  # name: type, shape


def check_signature(session: onnxruntime.InferenceSession, model: Model) -> None:
    """Raise RefusedError unless inputs and outputs have the contract's names, types and shapes."""
    inputs: _Nodes = {INPUT: ("tensor(float)", ["draws", model.latent_size])}
    energy, direction, charge = OUTPUTS
    outputs: _Nodes = {
        energy: ("tensor(float)", ["muons"]),
        direction: ("tensor(float)", ["muons", 3]),
        charge: ("tensor(int8)", ["muons"]),
    }
    _check_nodes(model.name, "input", session.get_inputs(), inputs)
    _check_nodes(model.name, "output", session.get_outputs(), outputs, {RATE: ("tensor(float)", [1])})


def _check_nodes(
    name: str,
    role: str,
    nodes: Sequence[onnxruntime.NodeArg],
    expected: _Nodes,
    optional: _Nodes | None = None,
) -> None:
    try:
        found = {node.name: (node.type, node.shape) for node in nodes}
    except UnicodeDecodeError as error:
        raise RefusedError(f"{name} breaks the contract: the name of an {role} is no text in UTF-8") from error
    expected = {**expected, **{key: value for key, value in (optional or {}).items() if key in found}}
    if found.keys() != expected.keys():
        raise RefusedError(
            f"{name} breaks the contract: its {role}s are {shown(', '.join(found))}, "
            f"and should be {', '.join(expected)}"
        )
    for node, (kind, shape) in expected.items():
        if found[node] != (kind, shape):
            raise RefusedError(
                f"{name} breaks the contract: its {role} {node} is {found[node][0]} {shown(str(found[node][1]))}, "
                f"and should be {kind} {shape}"
            )
