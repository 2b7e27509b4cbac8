"""Whether a loaded model keeps the ONNX contract, version 2."""

from __future__ import annotations

from collections.abc import Sequence

import onnxruntime

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import METADATA_PREFIX, Model

__all__ = ["INPUT", "OUTPUTS", "RATE", "check_signature", "contract_metadata"]

INPUT = "latent"
OUTPUTS = ("kinetic_energy", "direction", "charge")
RATE = "rate_hz_per_m2"

_Nodes = dict[str, tuple[str, list[str | int]]]  # name: type, shape


def contract_metadata(session: onnxruntime.InferenceSession, name: str) -> dict[str, str]:
    """Return the keys of the contract in the metadata of a model of this name, without their prefix.

    Raises
    ------
    RefusedError
        If a key or a value is no text.
    """
    try:
        metadata = session.get_modelmeta().custom_metadata_map
    except UnicodeDecodeError as error:
        raise RefusedError(f"{name} breaks the contract: its metadata is no text in UTF-8") from error
    return {
        key.removeprefix(METADATA_PREFIX): value for key, value in metadata.items() if key.startswith(METADATA_PREFIX)
    }


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
    found = session.get_outputs()
    if any(node.name == RATE for node in found):
        outputs[RATE] = ("tensor(float)", [1])
    _check_nodes(model.name, "output", found, outputs)


def _check_nodes(
    name: str,
    role: str,
    nodes: Sequence[onnxruntime.NodeArg],
    expected: _Nodes,
) -> None:
    try:
        found = {node.name: (node.type, node.shape) for node in nodes}
    except UnicodeDecodeError as error:
        raise RefusedError(f"{name} breaks the contract: the name of an {role} is no text in UTF-8") from error
    if found.keys() != expected.keys():
        raise RefusedError(
            f"{name} breaks the contract: its {role}s are {', '.join(found)}, and should be {', '.join(expected)}"
        )
    for node, (kind, shape) in expected.items():
        if found[node] != (kind, shape):
            raise RefusedError(
                f"{name} breaks the contract: its {role} {node} is {found[node][0]} {found[node][1]}, "
                f"and should be {kind} {shape}"
            )
