from __future__ import annotations

import numpy as np
import onnxruntime
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from onnx import TensorProto
from scipy.interpolate import RegularGridInterpolator

from deepmuon_training.energy_transform import box_cox
from deepmuon_training.export.graph import Graph
from deepmuon_training.export.graph_steps import (
    LARGEST_LATENT,
    bilinear,
    bilinear_cells,
    columns,
    interpolation_cells,
    kinetic_energy,
    look_up,
    matrix,
    on_plane,
    place,
)

RANDOM = np.random.default_rng(1)


def run(g: Graph, output: str, shape: list[str | int], **inputs: np.ndarray) -> np.ndarray:
    shapes = {name: ["n", *value.shape[1:]] for name, value in inputs.items()}
    model = g.model(shapes, {"y": (output, TensorProto.FLOAT, shape)}, {})
    return onnxruntime.InferenceSession(model.SerializeToString()).run(None, inputs)[0]


def test_the_largest_latent_is_the_last_float32_below_1():
    assert np.float32(LARGEST_LATENT) == np.nextafter(np.float32(1), np.float32(0)) == LARGEST_LATENT


def test_columns_of_a_matrix_make_it_again():
    x, g = RANDOM.random((7, 3), dtype=np.float32), Graph()
    np.testing.assert_array_equal(run(g, matrix(g, *columns(g, "x", 3)), ["n", 3], x=x), x)


def test_a_column_holds_one_number_of_each_row():
    x, g = RANDOM.random((7, 3), dtype=np.float32), Graph()
    np.testing.assert_array_equal(run(g, columns(g, "x", 3)[1], ["n"], x=x), x[:, 1])


def test_the_energy_is_the_box_cox_transform_within_its_range():
    x, g = np.linspace(0.5, 12, 1000, dtype=np.float32), Graph()
    found = run(g, kinetic_energy(g, "x", (0.01, 1e4)), ["n"], x=x)
    np.testing.assert_allclose(found, np.clip(box_cox(x.astype(float)), 0.01, 1e4), rtol=2e-6)


def table_at(table: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Look up values of a table with one knot to a unit."""
    g = Graph()
    cell, inside = place(g, "x", 1.0)
    index = g("Cast", cell, to=TensorProto.INT32)
    start, slope = (look_up(g, part, index) for part in interpolation_cells(g, table))
    return run(g, g("Add", start, g("Mul", inside, slope)), ["n"], x=x)


def test_a_table_is_read_by_linear_interpolation():
    table = RANDOM.normal(size=50).astype(np.float32)
    x = np.float32(48.999) * RANDOM.random(1000, dtype=np.float32)
    np.testing.assert_allclose(table_at(table, x), np.interp(x, np.arange(50), table), atol=1e-5)


def test_a_table_is_exact_at_its_knots():
    table = RANDOM.normal(size=50).astype(np.float32)
    np.testing.assert_array_equal(table_at(table, np.arange(49, dtype=np.float32)), table[:-1])


ROWS, COLUMNS = 6, 9
TABLE = RANDOM.normal(size=(ROWS, COLUMNS)).astype(np.float32)
BILINEAR = RegularGridInterpolator((np.arange(ROWS), np.arange(COLUMNS)), TABLE)
PLACES = np.float32([ROWS - 1.001, COLUMNS - 1.001]) * RANDOM.random((1000, 2), dtype=np.float32)


def test_a_table_of_two_dimensions_is_read_by_bilinear_interpolation():
    g = Graph()
    row, column = columns(g, "x", 2)
    (i, a), (j, b) = place(g, row, 1.0), place(g, column, 1.0)
    cell = g("Cast", g("Add", g("Mul", i, float(COLUMNS - 1)), j), to=TensorProto.INT32)
    coefficients = [look_up(g, part, cell) for part in bilinear_cells(g, TABLE)]
    found = run(g, on_plane(g, coefficients, a, b), ["n"], x=PLACES)
    np.testing.assert_allclose(found, BILINEAR(PLACES), atol=1e-5)


@given(row=st.floats(0, ROWS - 1.001), column=st.floats(0, COLUMNS - 1.001))
def test_the_evaluation_in_pytorch_is_bilinear_interpolation(row, column):
    i, j = int(row), int(column)
    arguments = torch.tensor(i), torch.tensor(row - i), torch.tensor(j), torch.tensor(column - j)
    found = bilinear(torch.from_numpy(TABLE), *arguments)
    assert float(found) == pytest.approx(BILINEAR([[row, column]])[0], abs=1e-5)


def test_the_place_of_a_negative_value_counts_from_the_knot_below():
    g = Graph()
    cell, inside = place(g, "x", 2.0)
    found = run(g, matrix(g, cell, inside), ["n", 2], x=np.array([-1.25, -0.5, 0.0, 0.4], dtype=np.float32))
    np.testing.assert_allclose(found, [[-3, 0.5], [-1, 0], [0, 0], [0, 0.8]], atol=1e-6)
