"""What an exported file holds: its graph, its constants, its metadata."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import numpy_helper

from deepmuon_runtime.model.metadata import METADATA_PREFIX

__all__ = ["StoredGenerator"]


class StoredGenerator:
    """The numbers of an ONNX file that `deepmuon_training.export.onnx_export.export` wrote.

    Parameters
    ----------
    contents
        Of the file.

    Attributes
    ----------
    graph
        As onnx has it.
    constants
        Arrays by name.
    metadata
        Without its prefix.
    """

    def __init__(self, contents: bytes) -> None:
        model = onnx.load_from_string(contents)
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
        """Lowest and highest kinetic energy [GeV]."""
        return float(self.metadata["energy_min_gev"]), float(self.metadata["energy_max_gev"])

    @property
    def energy_mean(self) -> float:
        """Mean of the transformed energy in training; NaN of what was a family, where each knot had another."""
        return float(self.metadata.get("energy_mean", "nan"))
