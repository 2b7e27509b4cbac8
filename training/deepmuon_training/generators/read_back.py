"""Reads an exported file's numbers back, for an evaluation in PyTorch that no ONNX engine has a part in."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import numpy_helper
from torch import nn

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.metadata import METADATA_PREFIX
from deepmuon_training.energy_transform import EnergyTransform
from deepmuon_training.export.onnx_export import Exportable
from deepmuon_training.generators.quantile.tables import QuantileTables
from deepmuon_training.generators.transformer.model import ChargeTable, TransformerModel
from deepmuon_training.generators.transformer.network import Transformer

__all__ = ["read_back"]


def read_back(contents: bytes) -> Exportable:
    """Return the generator that a file was exported from, as stored numbers.

    Parameters
    ----------
    contents
        Of an ONNX file that `deepmuon_training.export.onnx_export.export` wrote.

    Raises
    ------
    RefusedError
        If the generator found does not give the file's graph again, node by node and number by number: another
        exporter wrote it.
    """
    stored = _Stored(onnx.load_from_string(contents))
    architecture = stored.metadata.get("architecture", "none")
    try:
        generator = _READERS[architecture](stored)
    except (KeyError, ValueError, StopIteration) as error:
        raise RefusedError(f"a graph of architecture {architecture} that this release does not write") from error
    again = generator.graph()[0]
    outputs = len(stored.graph.output)  # a node each, to give it its name
    if again.nodes != stored.graph.node[:-outputs] or again.initializers != list(stored.graph.initializer):
        raise RefusedError(f"a graph of architecture {architecture} that this release would write otherwise")
    return generator


class _Stored:
    """What a file holds: its graph, its constants by name, its metadata."""

    def __init__(self, model: onnx.ModelProto) -> None:
        self.graph = model.graph
        self.constants = {tensor.name: numpy_helper.to_array(tensor).copy() for tensor in model.graph.initializer}
        self.metadata = {prop.key.removeprefix(METADATA_PREFIX): prop.value for prop in model.metadata_props}

    def tables(self) -> list[NDArray[np.float32]]:
        """Return the matrices of float32, in the graph's order."""
        return [array for array in self.constants.values() if array.ndim == 2 and array.dtype == np.float32]

    def weights(self) -> Iterator[torch.Tensor]:
        """Yield what is stored as float16, each time that the graph uses it."""
        for node in self.graph.node:
            if node.op_type == "Cast" and node.input[0] in self.constants:
                yield torch.from_numpy(self.constants[node.input[0]].astype(np.float32))

    @property
    def energy_range(self) -> tuple[float, float]:
        return float(self.metadata["energy_min_gev"]), float(self.metadata["energy_max_gev"])

    @property
    def energy_mean(self) -> float:
        return float(self.metadata["energy_mean"])


def _quantile(stored: _Stored) -> QuantileTables:
    energy, zenith, charge = stored.tables()
    return QuantileTables(energy.ravel(), zenith, charge, stored.energy_range, stored.energy_mean)


def _transformer(stored: _Stored) -> TransformerModel:
    network = Transformer(int(stored.metadata["muons_per_draw"]))
    with torch.no_grad():
        for parameter, weight in zip(_in_graphs_order(network), stored.weights(), strict=True):
            parameter.copy_(weight.T if weight.ndim == 2 else weight)
    angle, charge = stored.tables()
    return TransformerModel(
        network,
        transform=EnergyTransform(stored.energy_mean),
        angle=angle.ravel(),
        charge=ChargeTable(charge, _charge_range(stored, len(charge))),
        energy_range=stored.energy_range,
    )


def _in_graphs_order(network: Transformer) -> Iterator[nn.Parameter]:
    yield from network.embedding.parameters()
    yield from network.norm.parameters()
    for layer in network.encoder.layers:
        for part in (layer.self_attn, layer.norm1, layer.linear1, layer.linear2, layer.norm2):
            yield from part.parameters()
    yield from network.decoder.parameters()


def _charge_range(stored: _Stored, rows: int) -> tuple[float, float]:
    """Return x of the charge table's first and last row, of row = (x - low) scale: the first constant subtracted."""
    nodes = zip(stored.graph.node, stored.graph.node[1:], strict=False)
    pairs = ((node, after) for node, after in nodes if node.op_type == "Sub" and node.input[1] in stored.constants)
    low, scale = (float(stored.constants[node.input[1]]) for node in next(pairs))
    return low, low + (rows - 1) / scale


_READERS: dict[str, Callable[[_Stored], Exportable]] = {"quantile": _quantile, "transformer": _transformer}
