from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from onnx import TensorProto
from scipy.special import expit
from scipy.stats import chi2

from deepmuon_runtime.latents.philox import latents
from deepmuon_runtime.model.look_ups import with_gather
from deepmuon_training.export.graph import Graph
from deepmuon_training.export.onnx_export import Training, export
from deepmuon_training.generators.quantile.cells import (
    ENERGY_CELLS,
    ENERGY_PER_UNIT,
    ROW_OF_CELL,
    ROWS,
    ZENITH_CELLS,
    energy_logit,
    row_logits,
    zenith_square,
)
from deepmuon_training.generators.quantile.graph import LATENT_SIZE, quantile_graph

OUTPUTS = ["kinetic_energy", "direction", "charge"]
LARGEST = 1 - 2**-24
Muons = list[np.ndarray]


@pytest.fixture(scope="module")
def file(quantile_tables, sample, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("quantile") / "model.onnx"
    export(quantile_tables, Training.of(sample, seed=1), path)
    return path


@pytest.fixture(scope="module")
def run(file: Path) -> Callable[[np.ndarray], Muons]:
    return runner(file.read_bytes())


def runner(content: bytes) -> Callable[[np.ndarray], Muons]:
    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    return lambda latent: session.run(OUTPUTS, {"latent": latent.astype(np.float32)})


def loaded(model: bytes | Path, folder: Path) -> list[str]:
    """Operators that ONNX Runtime leaves in a model when it has loaded it."""
    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(folder / "loaded.onnx")
    options.log_severity_level = 4  # it warns of writing such a file
    onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    return [node.op_type for node in onnx.load(folder / "loaded.onnx").graph.node]


def test_runtimes_make_the_large_tables_while_they_load(file, tmp_path):
    left = loaded(file, tmp_path)
    assert len(left) <= 50
    assert left.count("GatherElements") == 6
    assert not {"MatMul", "Range", "Slice", "Exp", "Expand", "Reciprocal"} & set(left)


def model_of(energy: Callable[[Graph], str], tables) -> bytes:
    """Return a model whose table of energy is what some nodes make of constants."""
    g = Graph()
    names = energy(g), g.constant(tables.zenith), g.constant(tables.charge)
    values = quantile_graph(g, *names, tables.energy_range)
    kinds = [(TensorProto.FLOAT, ["n"]), (TensorProto.FLOAT, ["n", 3]), (TensorProto.INT8, ["n"])]
    outputs = {name: (value, *kind) for name, value, kind in zip(OUTPUTS, values, kinds, strict=True)}
    return g.model({"latent": ["n", LATENT_SIZE]}, outputs, {}).SerializeToString()


def test_a_coarse_table_may_be_computed_of_constants_before_it(quantile_tables, tmp_path):
    halves = quantile_tables.energy / 2

    def computed(g: Graph) -> str:
        with g.scope("depth"):
            return g("Add", halves, g("Mul", halves, 1.0))

    models = [model_of(energy, quantile_tables) for energy in (lambda g: g.constant(quantile_tables.energy), computed)]
    assert loaded(models[0], tmp_path) == loaded(models[1], tmp_path)
    latent = latents(seed=1, first=0, draws=10_000, latent_size=LATENT_SIZE)
    for stored, found in zip(*(runner(model)(latent) for model in models), strict=True):
        np.testing.assert_array_equal(found, stored)


def test_gather_in_place_of_gather_elements_gives_the_same_muons_bit_by_bit(file, run):
    content = with_gather(file.read_bytes())
    operators = [node.op_type for node in onnx.load_from_string(content).graph.node]
    assert operators.count("GatherElements") == 0
    assert operators.count("Gather") == 6
    latent = latents(seed=2, first=0, draws=100_000, latent_size=LATENT_SIZE)
    latent[0], latent[1], latent[2] = -1, 0, 1
    for found, expected in zip(runner(content)(latent), run(latent), strict=True):
        np.testing.assert_array_equal(found.view(np.uint8), expected.view(np.uint8))


@pytest.mark.parametrize("side", [-1, 1])
def test_hardly_two_of_ten_thousand_muons_in_a_tail_have_the_same_energy(run, side):
    n = 10_000
    latent = latents(seed=3, first=0, draws=n, latent_size=LATENT_SIZE)
    steps = np.random.default_rng(4).integers(0, int(2**22 * 1e-3), n)  # the outermost thousandth, on the lattice
    latent[:, 0] = side * (LARGEST - steps * 2.0**-22)
    energy = run(latent)[0]
    assert len(np.unique(energy)) > 0.98 * n


def histograms(energy: np.ndarray, direction: np.ndarray) -> dict[str, np.ndarray]:
    log_energy, cos_zenith = np.log10(energy), -direction[:, 2].astype(float)
    from_vertical = np.hypot(direction[:, 0], direction[:, 1])
    plane = np.histogram2d(log_energy, cos_zenith, (40, 40), ((-2, 3), (0, 1)))[0]
    return {
        "energy": np.histogram(log_energy, 500, (-3, 5))[0],
        "zenith": np.histogram(cos_zenith, 500, (0, 1))[0],
        "vertical": np.histogram(from_vertical, 50, (0, 0.1))[0],
        "horizon": np.histogram(cos_zenith, 50, (0, 0.3))[0],
        "both": plane.ravel(),
    }


def directly(quantile, latent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Energy and direction of the maps themselves; the zenith at one of 400 energies, evenly in the level's logit."""
    l0, l1, l2 = torch.from_numpy(latent[:, :3]).double().T
    t, level = energy_logit(l0, l1).numpy(), torch.logit((1 + l2) / 2).numpy()
    energies, logit = np.linspace(-12, 12, 401), np.empty(len(t))
    nearest = np.rint(np.interp(t, energies, np.arange(401))).astype(int)
    for number in np.unique(nearest):
        mine = nearest == number
        logit[mine] = quantile.cos_zenith_logit(level[mine], energies[number : number + 1])[0]
    sine = np.sqrt(expit(-logit) * (1 + expit(logit)))
    return np.exp(quantile.log_energy(t)), np.stack([sine, 0 * sine, -expit(logit)], axis=1)


def test_the_muons_have_the_distribution_of_the_maps(quantile, run):
    """Tables, rows chosen by dithering, float32: none of it shows among 400,000 muons."""
    n = 400_000
    energy, direction, _ = run(latents(seed=5, first=0, draws=n, latent_size=LATENT_SIZE))
    right = histograms(*directly(quantile, latents(seed=6, first=0, draws=n, latent_size=LATENT_SIZE)))
    for name, found in histograms(energy, direction).items():
        both = (found + right[name]).astype(float)
        enough = both > 20
        assert enough.sum() > 10
        chi_square = np.sum((found - right[name])[enough] ** 2 / both[enough])
        assert chi2.sf(chi_square, enough.sum()) > 1e-4, name  # five of them: a false alarm in 2000 seeds


def test_rows_are_read_in_the_shares_that_interpolation_would_give_them():
    row = row_logits().numpy()
    cell = np.arange(ENERGY_CELLS - 1)
    t = (cell + 0.5) / ENERGY_PER_UNIT
    chosen = row[ROW_OF_CELL[: ENERGY_CELLS - 1]]
    inside = t < row[-1] - 1
    window = np.ones(16) / 16
    error = np.convolve(chosen - t, window, "valid")[: inside.sum() - 16]
    assert np.abs(error).max() < 0.05  # where rows are up to 0.6 apart
    assert np.all(np.abs(np.searchsorted(row, t[inside]) - ROW_OF_CELL[: inside.sum()]) <= 1)
    mirrored = ROW_OF_CELL[-1:-ENERGY_CELLS:-1] + ROW_OF_CELL[1:ENERGY_CELLS]
    assert np.abs(mirrored.astype(int) - (ROWS - 1)).max() <= 1


def test_no_latent_is_beyond_the_cells():
    ends = torch.tensor([-LARGEST, LARGEST], dtype=torch.float64)
    place = torch.sqrt(zenith_square(ends))
    assert ZENITH_CELLS - 1 < place[0] < ZENITH_CELLS
    assert 0 < place[1] < 1
    t = energy_logit(ends, -torch.tensor(LARGEST, dtype=torch.float64))
    assert torch.all(t.abs() * ENERGY_PER_UNIT < ENERGY_CELLS - 1)
