from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from onnx import TensorProto
from support.engines import reference_evaluator

from deepmuon_runtime import Generator
from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_runtime.latents.philox import latents
from deepmuon_training.export.exportable import Exportable
from deepmuon_training.export.graph import Graph
from deepmuon_training.export.metadata import Training
from deepmuon_training.export.onnx_export import export
from deepmuon_training.generators.transformer.fit import TransformerSettings
from deepmuon_training.generators.transformer.model import TransformerModel
from deepmuon_training.generators.transformer.network import LATENTS, Transformer

OUTPUTS = ["kinetic_energy", "direction", "charge"]
Muons = list[np.ndarray]


@pytest.fixture(scope="module")
def proto(model: Path) -> onnx.ModelProto:
    return onnx.load(model)


@pytest.fixture(scope="module")
def run(model: Path) -> Callable[[np.ndarray], Muons]:
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    return lambda latent: session.run(OUTPUTS, {"latent": latent.astype(np.float32)})


def end_points(latent_size: int) -> np.ndarray:
    """Draws of -1, 0 and 1 only: all there are of five latents, else a thousand."""
    if latent_size == 5:
        return np.float32(list(product([-1, 0, 1], repeat=5)))
    return np.random.default_rng(1).integers(-1, 2, size=(1000, latent_size)).astype(np.float32)


def assert_physical(muons: Muons, energy_range: tuple[float, float]) -> None:
    energy, direction, charge = muons
    low, high = np.float32(energy_range)
    assert np.all((energy >= low) & (energy <= high))
    np.testing.assert_allclose(np.linalg.norm(direction.astype(float), axis=1), 1, atol=1e-6)
    assert np.all(direction[:, 2] < 0)
    assert np.all(np.abs(charge) == 1)


def test_a_model_says_what_the_contract_asks_for(proto, exportable):
    low, high = exportable.energy_range
    assert {p.key: p.value for p in proto.metadata_props} == {
        "deepmuon.contract_version": "2",
        "deepmuon.architecture": exportable.architecture,
        "deepmuon.depth_m": "0",
        "deepmuon.medium": "water",
        "deepmuon.surface": "0",
        "deepmuon.muons_per_draw": str({"quantile": 1, "transformer": 16}[exportable.architecture]),
        "deepmuon.latent_size": str({"quantile": 5, "transformer": 132}[exportable.architecture]),
        "deepmuon.energy_min_gev": str(low),
        "deepmuon.energy_max_gev": str(high),
        "deepmuon.created_by": f"deepmuon-training {version('deepmuon-training')}",
        "deepmuon.licence": "BSD-3-Clause",
        "deepmuon.rate_hz_per_m2": "129.035",
        "deepmuon.rate_uncertainty_hz_per_m2": "0.25",
        "deepmuon.rate_relative_uncertainty": "0.00194",
        "deepmuon.boxcox_lambda": "9",
        "deepmuon.energy_mean": f"{exportable.energy_mean:.9g}",
        "deepmuon.training_source": "a parametric flux",
        "deepmuon.training_smoothed": "true",
        "deepmuon.training_muons": "100000",
        "deepmuon.training_seed": "1",
        **({"deepmuon.energy_latents": "0 1"} if exportable.architecture == "quantile" else {}),
    }


def test_a_model_leaves_out_what_is_unknown(exportable, sample, tmp_path):
    unknown = replace(sample, rate=None, rate_uncertainty=None, smoothed=None)
    export(exportable, Training.of(unknown, seed=1), tmp_path / "model.onnx")
    keys = {p.key.removeprefix("deepmuon.") for p in onnx.load(tmp_path / "model.onnx").metadata_props}
    assert keys.isdisjoint({"rate_hz_per_m2", "rate_uncertainty_hz_per_m2", "training_smoothed", "flux"})
    assert "rate_hz_per_m2" not in {value.name for value in onnx.load(tmp_path / "model.onnx").graph.output}
    assert {"depth_m", "training_seed"} <= keys


def nodes(values: Any) -> dict[str, tuple[int, list[str | int]]]:
    return {
        value.name: (
            value.type.tensor_type.elem_type,
            [dim.dim_param or dim.dim_value for dim in value.type.tensor_type.shape.dim],
        )
        for value in values
    }


def test_inputs_and_outputs_are_the_contracts(proto, exportable):
    assert nodes(proto.graph.input) == {"latent": (TensorProto.FLOAT, ["draws", exportable.latent_size])}
    assert nodes(proto.graph.output) == {
        "kinetic_energy": (TensorProto.FLOAT, ["muons"]),
        "direction": (TensorProto.FLOAT, ["muons", 3]),
        "charge": (TensorProto.INT8, ["muons"]),
        "rate_hz_per_m2": (TensorProto.FLOAT, [1]),
    }


def test_a_model_gives_its_rate_without_a_muon(model, exportable, sample):
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    (rate,) = session.run(["rate_hz_per_m2"], {"latent": np.zeros((0, exportable.latent_size), dtype=np.float32)})
    np.testing.assert_array_equal(rate, np.float32([sample.rate]))


def test_a_model_passes_the_full_check_of_onnx(proto):
    onnx.checker.check_model(proto, full_check=True)


def test_a_model_is_one_that_old_runtimes_read(proto):
    assert [entry.domain for entry in proto.opset_import] == [""]
    assert proto.opset_import[0].version <= 20
    assert proto.ir_version <= 9
    assert not proto.functions


def test_a_model_has_only_standard_deterministic_operators_and_no_external_data(proto):
    for node in proto.graph.node:
        assert node.domain == ""
        assert not node.op_type.startswith(("Random", "Bernoulli", "Multinomial"))
    assert not any(tensor.external_data for tensor in proto.graph.initializer)
    assert all(tensor.data_location == TensorProto.DEFAULT for tensor in proto.graph.initializer)


def test_every_node_has_a_name_of_its_own(proto):
    """ONNX Runtime 1.19 to 1.21 refuse graphs in which they fuse nodes without names."""
    names = [node.name for node in proto.graph.node]
    assert all(names)
    assert len(set(names)) == len(names)


def test_the_charge_is_computed_in_float_and_cast_last(proto):
    assert [node.op_type for node in proto.graph.node if "charge" in node.output] == ["Identity"]
    integers = [
        node for node in proto.graph.node if any(a.name == "to" and a.i == TensorProto.INT8 for a in node.attribute)
    ]
    assert [node.op_type for node in integers] == ["Cast"]


def test_the_same_training_gives_the_same_bytes(exportable, sample, model, tmp_path):
    export(exportable, Training.of(sample, seed=1), tmp_path / "again.onnx")
    assert (tmp_path / "again.onnx").read_bytes() == model.read_bytes()


def test_the_difference_from_pytorch_is_rounding(exportable, sample, tmp_path):
    mismatch = export(exportable, Training.of(sample, seed=1), tmp_path / "model.onnx")
    assert mismatch.energy < 5e-5
    assert mismatch.direction < 1e-5
    assert mismatch.charges < 20


class Faulty:
    """A generator whose graph is not what PyTorch evaluates."""

    def __init__(self, generator: Exportable, fault: Callable[[Graph, str, str, str], tuple[str, str, str]]) -> None:
        self._generator, self._fault = generator, fault

    def __getattr__(self, name: str) -> Any:
        return getattr(self._generator, name)

    def __call__(self, latent: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        return self._generator(latent)

    def graph(self) -> tuple[Graph, str, str, str]:
        g, energy, direction, charge = self._generator.graph()
        return g, *self._fault(g, energy, direction, charge)


def negative_above(g: Graph, energy: str, charge: str, limit: float) -> str:
    return g(
        "Cast",
        g("Where", g("Greater", energy, limit), -1.0, g("Cast", charge, to=TensorProto.FLOAT)),
        to=TensorProto.INT8,
    )


FAULTS = {
    "energy by 1e-3": lambda g, e, d, c: (g("Mul", e, 1.001), d, c),
    "energies above 20 GeV": lambda g, e, d, c: (g("Min", e, 20.0), d, c),
    "no number above 20 GeV": lambda g, e, d, c: (g("Where", g("Greater", e, 20.0), float("nan"), e), d, c),
    "length of directions": lambda g, e, d, c: (e, g("Mul", d, 1.0001), c),
    "no direction": lambda g, e, d, c: (e, g("Mul", d, float("nan")), c),
    "upward": lambda g, e, d, c: (e, g("Neg", d), c),
    "charges above 20 GeV": lambda g, e, d, c: (e, d, negative_above(g, e, c, 20.0)),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_graph_that_differs_is_not_written(exportable, sample, tmp_path, fault):
    path = tmp_path / "model.onnx"
    with pytest.raises(FailedError, match="ONNX Runtime and PyTorch differ by"):
        export(Faulty(exportable, FAULTS[fault]), Training.of(sample, seed=1), path)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_exists_is_replaced_only_if_wanted(exportable, sample, tmp_path):
    path = tmp_path / "model.onnx"
    path.write_text("an older model")
    with pytest.raises(RefusedError, match="exists already"):
        export(exportable, Training.of(sample, seed=1), path)
    assert path.read_text() == "an older model"


def test_a_graph_without_fault_is_written(exportable, sample, tmp_path):
    export(Faulty(exportable, lambda g, e, d, c: (e, d, c)), Training.of(sample, seed=1), tmp_path / "model.onnx")
    assert (tmp_path / "model.onnx").exists()


def test_a_file_that_exists_outlives_a_failed_export(exportable, sample, tmp_path):
    path = tmp_path / "model.onnx"
    path.write_text("an older model")
    with pytest.raises(FailedError):
        export(Faulty(exportable, FAULTS["upward"]), Training.of(sample, seed=1), path, overwrite=True)
    assert path.read_text() == "an older model"


def test_the_reference_evaluator_of_onnx_agrees_with_onnx_runtime(proto, run, exportable):
    size = exportable.latent_size
    latent = latents(seed=3, first=0, draws=300, latent_size=size)
    corners = end_points(size)[:300]
    if exportable.architecture == "transformer":
        corners[:, LATENTS:] = latents(seed=4, first=0, draws=300, latent_size=size - LATENTS)  # among equal keys
        # the evaluator sorts the other way round than the standard says
    latent = np.concatenate([latent, corners])
    energy, direction, charge = run(latent)
    found_energy, found_direction, found_charge = reference_evaluator(proto).run(OUTPUTS, {"latent": latent})
    np.testing.assert_allclose(found_energy, energy, rtol=1e-4)
    np.testing.assert_allclose(found_direction, direction, atol=1e-5)
    assert np.mean(found_charge != charge) < 1e-3
    assert found_charge.dtype == np.int8


@given(data=st.data())
@settings(max_examples=50)
def test_no_latent_makes_an_unphysical_muon(run, exportable, data):
    latent = data.draw(arrays(np.float32, (4, exportable.latent_size), elements=st.floats(-1, 1, width=32)))
    assert_physical(run(latent), exportable.energy_range)


def test_end_points_make_physical_muons(run, exportable):
    assert_physical(run(end_points(exportable.latent_size)), exportable.energy_range)


def test_latents_outside_their_range_are_clamped_to_it(run, exportable):
    outside = np.random.default_rng(2).choice(np.float32([-1e30, -1.5, 1.0001, 7]), (500, exportable.latent_size))
    for found, expected in zip(run(outside), run(np.clip(outside, -1, 1)), strict=True):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("draws", [1, 7, 1000])
def test_any_number_of_draws_gives_its_muons(run, exportable, draws):
    muons = run(latents(seed=1, first=0, draws=draws, latent_size=exportable.latent_size))
    count = draws * exportable.muons_per_draw
    assert [part.shape for part in muons] == [(count,), (count, 3), (count,)]
    assert [part.dtype for part in muons] == [np.float32, np.float32, np.int8]


def test_the_runtime_opens_a_model_and_knows_its_rate(model, sample):
    generator = Generator.open(file=model, device="cpu", threads=1)
    assert generator.model.rate_hz_per_m2 == pytest.approx(sample.rate, rel=1e-5)
    assert len(generator.sample(1001, seed=1)) == 1001


@pytest.mark.parametrize("energy_max", [5.000001430511475, 4.999999046325684])
def test_muons_at_the_ends_of_the_energy_range_are_within_it(transformer_model, sample, tmp_path, energy_max):
    """Both ends are written with all their digits: the runtime refuses muons outside of them."""
    clipped = replace(transformer_model, energy_range=(0.1000001, energy_max))
    export(clipped, Training.of(sample, seed=1), tmp_path / "model.onnx")
    muons = Generator.open(file=tmp_path / "model.onnx", device="cpu", threads=1).sample(10_000, seed=1)
    assert muons.kinetic_energy.min() == np.float32(0.1000001)
    assert muons.kinetic_energy.max() == np.float32(energy_max)


def test_transformers_are_stored_in_float16(transformer_model, sample, tmp_path):
    export(transformer_model, Training.of(sample, seed=1), tmp_path / "model.onnx")
    initializers = onnx.load(tmp_path / "model.onnx").graph.initializer
    stored = sum(np.prod(tensor.dims) for tensor in initializers if tensor.data_type == TensorProto.FLOAT16)
    assert stored == sum(parameter.numel() for parameter in transformer_model.network.parameters())


def test_models_of_the_released_sizes_are_small(quantile_tables, transformer_model, sample, tmp_path):
    torch.manual_seed(1)
    wide = TransformerModel.stored(
        Transformer(TransformerSettings().d),
        transform=transformer_model.transform,
        angle=transformer_model.angle,
        charge=transformer_model.charge,
        energy_range=transformer_model.energy_range,
    )
    for generator, size in ((quantile_tables, 106_000), (wide, 1_000_000)):
        export(generator, Training.of(sample, seed=1), tmp_path / "model.onnx", overwrite=True)
        assert (tmp_path / "model.onnx").stat().st_size <= size
