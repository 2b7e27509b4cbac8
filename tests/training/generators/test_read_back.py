from __future__ import annotations

from pathlib import Path

import onnx
import pytest
import torch
from support.tiny_models import tiny_model

from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.latents.philox import latents
from deepmuon_training.export.exportable import Exportable
from deepmuon_training.generators.read_back import read_back


def test_a_file_gives_its_generator_back(model: Path, exportable: Exportable):
    again = read_back(model.read_bytes())
    latent = torch.from_numpy(latents(seed=1, first=0, draws=200, latent_size=exportable.latent_size)).double()
    with torch.no_grad():
        energy, direction, charge = exportable(latent)
        energy_again, direction_again, charge_again = again(latent)
    torch.testing.assert_close(energy_again, energy, rtol=1e-7, atol=0)  # the mean has nine digits in the file
    torch.testing.assert_close(direction_again, direction, rtol=0, atol=0)
    assert (charge_again != charge).sum() <= 1  # a latent within rounding of its threshold


@pytest.mark.parametrize("tampered", ["operator", "number"])
def test_a_graph_that_is_not_what_the_generator_gives_is_refused(model: Path, tampered: str):
    proto = onnx.load(model)
    if tampered == "operator":
        next(node for node in proto.graph.node if node.op_type == "Sin").op_type = "Cos"
    else:
        pi_or_so = next(x for x in proto.graph.initializer if x.data_type == onnx.TensorProto.FLOAT and not x.dims)
        pi_or_so.CopyFrom(onnx.numpy_helper.from_array(onnx.numpy_helper.to_array(pi_or_so) / 2, pi_or_so.name))
    with pytest.raises(RefusedError, match="would write otherwise"):
        read_back(proto.SerializeToString())


def test_a_graph_of_another_exporter_is_refused():
    with pytest.raises(RefusedError, match="architecture quantile that this release does not write"):
        read_back(tiny_model())
    with pytest.raises(RefusedError, match="architecture flow that this release does not write"):
        read_back(tiny_model(metadata={"architecture": "flow"}))
