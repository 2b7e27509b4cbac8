from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.engines import reference_evaluator

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.export.graph import RATE, Graph
from deepmuon_training.families.knots import column_density_graph
from deepmuon_training.families.rate_table import read_rates
from deepmuon_training.families.rates import KnownRate, Rates

DEPTHS = np.array([0, 1, 3, 10, 20, 30, 50, 100.0])
PLANE = 120 * (1 + DEPTHS / 9) ** -1.7
RATES = np.stack([PLANE, 1.33 * PLANE])


def in_graph(rates: Rates, depth: float, surface: int) -> float:
    g = Graph()
    x = column_density_graph(g, g.changeable(np.array(depth, dtype=np.float32), "depth_m"), rates.density)
    rates.graph(g, x, g.changeable(np.array(surface, dtype=np.int64), "surface"))
    g("Mul", "latent", 1.0)
    model = g.model({"latent": ["n"]}, {"rate": (RATE, 1, [1])}, {})
    (rate,) = reference_evaluator(model).run(None, {"latent": np.zeros(1, np.float32)})[0]
    return float(rate)


@pytest.mark.parametrize("points", [2, 3, 4, 8])
def test_a_known_rate_is_what_it_is(points):
    rates = Rates(DEPTHS[:points].tolist(), RATES[:, :points], density=1.0)
    for surface in 0, 1:
        for depth, rate in zip(DEPTHS[:points], RATES[surface], strict=False):
            assert rates(depth, surface) == pytest.approx(rate, rel=1e-12)
            assert in_graph(rates, depth, surface) == pytest.approx(rate, rel=1e-6)


@given(st.floats(0, 100, width=32), st.sampled_from([0, 1]))
def test_between_depths_the_rate_is_smooth(depth, surface):
    rates = Rates(DEPTHS.tolist(), RATES, density=1.0)
    assert rates(depth, surface) == pytest.approx(RATES[surface, 0] * (1 + depth / 9) ** -1.7, rel=0.02)
    assert in_graph(rates, depth, surface) == pytest.approx(rates(depth, surface), rel=1e-6)


def test_a_rate_has_no_kink_at_a_knot():
    rates = Rates(DEPTHS.tolist(), RATES, density=1.0)
    step = 1e-3
    for depth in DEPTHS[1:-1]:
        left, here, right = (np.log(rates(depth + shift)) for shift in (-step, 0, step))
        assert abs(left - 2 * here + right) < 1e-6  # a change of the slope by 1e-3 a metre would show


def test_rates_of_a_pipelines_table_are_read(tmp_path):
    (tmp_path / "layers.csv").write_text(
        "depth_m,rate_hz_per_m2,rate_uncertainty_hz_per_m2,surviving_fraction\n0,120.5,0.25,1\n10,,,0.5\n20,30,,0.2\n"
    )
    assert read_rates(tmp_path / "layers.csv") == (KnownRate(0, 120.5, 0.25), KnownRate(20, 30.0))


HEADING = "depth_m,rate_hz_per_m2\n"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("depth,rate\n0,1\n", "no column depth_m: its first line should be depth_m,rate_hz_per_m2,"),
        ("", "no column depth_m"),
        (HEADING, "has no rate"),
        (f"{HEADING}0,-1\n", "line 2: rate_hz_per_m2 is '-1', and should be a finite number above 0"),
        (f"{HEADING}0,1\nnan,1\n", "line 3: depth_m is 'nan', and should be a finite number from 0 on"),
        (f"{HEADING}ten,1\n", "line 2: depth_m is 'ten'"),
        (f"{HEADING}0,inf\n", "line 2: rate_hz_per_m2 is 'inf'"),
    ],
)
def test_a_table_without_rates_is_refused_in_a_line(tmp_path, text, told):
    path = tmp_path / "rates.csv"
    path.write_text(text)
    with pytest.raises(RefusedError, match=told) as refused:
        read_rates(path)
    assert "\n" not in str(refused.value)
    with pytest.raises(RefusedError, match=r"missing\.csv can't be read: No such file"):
        read_rates(tmp_path / "missing.csv")
