"""A family as an ONNX file: what it says, that it folds while it loads, and that engines agree."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from support.engines import reference_evaluator

from deepmuon_runtime import Generator
from deepmuon_runtime.errors import FailedError, RefusedError
from deepmuon_runtime.latents.philox import latents
from deepmuon_runtime.model.baking import bake
from deepmuon_runtime.model.family import at_depth
from deepmuon_training.export.family_export import export_family
from deepmuon_training.export.metadata import Training
from deepmuon_training.export.onnx_export import export
from deepmuon_training.families.rates import KnownRate
from deepmuon_training.generators.quantile.family import QuantileFamily, quantile_family
from deepmuon_training.generators.quantile.tables import QuantileTables
from deepmuon_training.generators.read_back import read_back

DEPTHS = (0.0, 0.5, 2.0, 5.0, 12.0)
OUTPUTS = ["kinetic_energy", "direction", "charge", "rate_hz_per_m2"]
LATENT = latents(seed=3, first=0, draws=2000, latent_size=5)


def under(tables: QuantileTables, depth: float) -> QuantileTables:
    s = np.float32(np.log1p(depth))
    return replace(tables, energy=tables.energy + 0.3 * s, zenith=tables.zenith + 0.2 * s)


@pytest.fixture(scope="module")
def family(quantile_tables) -> QuantileFamily:
    rates = [KnownRate(depth, 120 / (1 + depth / 9), 0.2) for depth in DEPTHS]
    return quantile_family([(depth, under(quantile_tables, depth)) for depth in DEPTHS], 1.0, rates)


@pytest.fixture(scope="module")
def knots(sample) -> list[Training]:
    return [replace(Training.of(sample, seed=k), depth_m=depth, flux="test") for k, depth in enumerate(DEPTHS)]


@pytest.fixture(scope="module")
def file(family, knots, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("family") / "family.onnx"
    mismatch = export_family(family, knots, 0.0041, path)
    assert mismatch.energy < 5e-5
    assert mismatch.charges < 20
    return path


def session(contents: bytes, optimized: Path | None = None) -> onnxruntime.InferenceSession:
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    if optimized is not None:
        options.optimized_model_filepath = str(optimized)
    return onnxruntime.InferenceSession(contents, options, providers=["CPUExecutionProvider"])


def test_a_family_says_what_the_contract_asks_for(file):
    said = {prop.key.removeprefix("deepmuon."): prop.value for prop in onnx.load(file).metadata_props}
    assert said["contract_version"] == "2"
    assert (said["depth_m"], said["depth_min_m"], said["depth_max_m"], said["surface"]) == ("0", "0", "12", "0")
    assert said["knots_m"] == "0 0.5 2 5 12"
    assert (said["medium"], said["flux"], said["rate_relative_uncertainty"]) == ("water", "test", "0.0041")
    assert said["training_muons"] == "500000"
    assert "rate_hz_per_m2" not in said
    assert "training_seed" not in said  # each knot had another


def test_its_depth_and_surface_are_scalars_that_nothing_else_shares(file):
    graph = onnx.load(file).graph
    scalars = {tensor.name: tensor for tensor in graph.initializer if tensor.name in ("depth_m", "surface")}
    assert {name: (list(t.dims), t.data_type) for name, t in scalars.items()} == {
        "depth_m": ([], onnx.TensorProto.FLOAT),
        "surface": ([], onnx.TensorProto.INT32),
    }
    for name in scalars:
        assert all(node.name.startswith("depth/") for node in graph.node if name in node.input)


def test_what_depends_on_the_depth_ends_in_the_coarse_tables_and_the_rate(file):
    graph = onnx.load(file).graph
    made = {output for node in graph.node if node.name.startswith("depth/") for output in node.output}
    rest = [node for node in graph.node if not node.name.startswith("depth/")]
    assert {name for node in rest for name in node.input} & made == {
        "energy/table",
        "zenith/table",
        "charge/table",
        "rate/value",
    }


def test_at_a_knot_it_gives_the_muons_of_the_knots_own_file(file, family, knots, tmp_path):
    for knot, tables in zip(knots, family.planes, strict=True):
        export(tables, knot, tmp_path / "own.onnx", overwrite=True)
        own = session((tmp_path / "own.onnx").read_bytes()).run(OUTPUTS[:3], {"latent": LATENT})
        found = session(at_depth(file.read_bytes(), knot.depth_m)).run(OUTPUTS[:3], {"latent": LATENT})
        for right, column in zip(own, found, strict=True):
            np.testing.assert_array_equal(column, right)


def test_what_depends_on_the_depth_is_gone_once_the_file_is_loaded(file, family, knots, tmp_path):
    export(family.planes[0], knots[0], tmp_path / "own.onnx")
    operators = []
    for contents in (tmp_path / "own.onnx").read_bytes(), at_depth(file.read_bytes(), 3.3):
        session(contents, tmp_path / "loaded.onnx")
        nodes = onnx.load(tmp_path / "loaded.onnx").graph.node
        assert not [node.name for node in nodes if node.name.startswith("depth/")]
        operators.append(Counter(node.op_type for node in nodes))
    assert operators[0] == operators[1]


def test_a_muon_of_a_family_takes_as_long_as_one_of_what_is_baked_of_it(file, tmp_path):
    """Tables that were made again for each block of muons would take twenty times as long, and not twice."""
    (tmp_path / "baked.onnx").write_bytes(bake(file.read_bytes(), 3.3))
    family = Generator.open(3.3, file=file, device="cpu", threads=1)
    baked = Generator.open(file=tmp_path / "baked.onnx", device="cpu", threads=1)
    times: dict[Generator, list[float]] = {family: [], baked: []}
    for round_ in range(7):
        for generator, taken in times.items():
            begun = time.process_time()
            generator.sample(200_000, seed=round_)
            taken.append(time.process_time() - begun)
    assert min(times[family]) < 2 * min(times[baked])


def openvino_muons(contents: bytes) -> list[np.ndarray]:
    openvino = pytest.importorskip("openvino")
    core = openvino.Core()
    model = core.compile_model(core.read_model(contents), "CPU", {"INFERENCE_PRECISION_HINT": "f32"})
    found = model({"latent": LATENT})
    return [found[name] for name in OUTPUTS]


def tract_muons(contents: bytes) -> list[np.ndarray]:
    tract = pytest.importorskip("tract")
    Path("family.onnx").write_bytes(contents)
    found = tract.onnx().load("family.onnx").into_model().into_runnable().run([LATENT])
    return [tensor.to_numpy() for tensor in found]


ENGINES = {
    "ONNX Runtime": lambda contents: session(contents).run(OUTPUTS, {"latent": LATENT}),
    "OpenVINO": openvino_muons,
    "tract": tract_muons,
    "ONNX's reference evaluator": lambda contents: reference_evaluator(onnx.load_from_string(contents)).run(
        OUTPUTS, {"latent": LATENT}
    ),
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("depth", "surface"), [(0.0, 0), (3.3, 0), (12.0, 1), (0.2, 1)])
def test_every_engine_gives_the_muons_of_the_depth(file, family, engine, depth, surface, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    energy, direction, charge, rate = ENGINES[engine](at_depth(file.read_bytes(), depth, surface))
    depth = float(np.float32(depth))
    right = family.at(depth, surface)(torch.from_numpy(LATENT).double())
    np.testing.assert_allclose(energy, right[0], rtol=2e-5)
    off = np.abs(direction - right[1].numpy()).max(axis=1)
    assert np.sum(off > 1e-5) <= 2  # a latent within rounding of another row of the table
    assert np.sum(charge != right[2].numpy()) <= 2
    assert rate[0] == pytest.approx(family.rate(depth, surface), rel=1e-5)


def test_a_file_baked_from_it_holds_the_tables_of_its_depth(file, family):
    found, right = read_back(bake(file.read_bytes(), 3.3)), family.at(float(np.float32(3.3)))
    for name in "energy", "zenith", "charge":
        np.testing.assert_allclose(getattr(found, name), getattr(right, name), rtol=1e-5, atol=2e-6, err_msg=name)


def test_the_runtime_opens_it_at_any_depth(file, family):
    assert Generator.open(file=file, device="cpu").model.depth_m == 0
    generator = Generator.open(file=file, depth=7.7, device="cpu")
    assert generator.model.rate_hz_per_m2 == pytest.approx(family.rate(float(np.float32(7.7))), rel=1e-5)
    assert len(generator.sample(100, seed=1)) == 100
    with pytest.raises(RefusedError, match="from 0 to 12 m"):
        Generator.open(file=file, depth=13, device="cpu")


def test_the_same_knots_give_the_same_bytes(file, family, knots, tmp_path):
    export_family(family, knots, 0.0041, tmp_path / "again.onnx")
    assert (tmp_path / "again.onnx").read_bytes() == file.read_bytes()


def test_the_medium_is_that_of_its_depths_and_not_of_sea_level(family, knots, tmp_path):
    rock = [replace(knot, medium="standard_rock 2.65 g/cm3") if knot.depth_m else knot for knot in knots]
    export_family(family, rock, None, tmp_path / "family.onnx")
    assert Generator.open(file=tmp_path / "family.onnx", device="cpu").model.medium == "rock"


def test_an_unknown_rate_is_no_output(family, knots, tmp_path):
    export_family(replace(family, rates=None), knots, None, tmp_path / "family.onnx")
    assert len(onnx.load(tmp_path / "family.onnx").graph.output) == 3


class Faulty:
    """A family whose PyTorch evaluation is another than its graph."""

    def __init__(self, family: QuantileFamily, depth: float, rate: float) -> None:
        self._family, self._depth, self._rate = family, depth, rate

    def __getattr__(self, name: str) -> object:
        return getattr(self._family, name)

    def at(self, depth_m: float, surface: int) -> QuantileTables:
        return self._family.at(depth_m if depth_m < 5 else depth_m + self._depth, surface)

    def rate(self, depth_m: float, surface: int) -> float:
        return self._family.rate(depth_m, surface) * self._rate


@pytest.mark.parametrize(("depth", "rate"), [(-0.5, 1.0), (0.0, 1.001)])
def test_a_family_that_gives_other_muons_or_rates_is_not_written(family, knots, depth, rate, tmp_path):
    with pytest.raises(FailedError):
        export_family(Faulty(family, depth, rate), knots, None, tmp_path / "family.onnx")
    assert not list(tmp_path.iterdir())
