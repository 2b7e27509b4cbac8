from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from deepmuon_runtime.errors import RefusedError
from deepmuon_training.fluxes.measured import MEASURED
from deepmuon_training.fluxes.table import read_flux_table

GOOD = """\
# E_GeV, cos zenith, mu+, mu-
E_GeV,cos_zenith,plus,minus
1,1,8,6
10,1,0.8,0.6
100,1,0.008,0.004
1,0.5,2,2

10,0.5,0.4,0.2
100,0.5,0.01,0.005
"""


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def lines(energy, cosines, grid) -> str:
    rows = [(e, c, *grid[i, j]) for i, c in enumerate(cosines) for j, e in enumerate(energy)]
    return "".join(",".join(f"{x:.17g}" for x in row) + "\n" for row in rows)


def test_the_flux_at_the_lines_of_a_table_is_theirs(tmp_path):
    flux = read_flux_table(write(tmp_path / "mine.csv", GOOD))
    plus, minus = flux.intensity(np.array([1.0, 10.0, 100.0]), np.array([[1.0], [0.5]]))
    np.testing.assert_allclose(plus, [[8, 0.8, 0.008], [2, 0.4, 0.01]])
    np.testing.assert_allclose(minus, [[6, 0.6, 0.004], [2, 0.2, 0.005]])
    assert (flux.name, flux.energy_min, flux.energy_max) == ("mine.csv", 1.0, 100.0)


def test_between_the_lines_it_goes_as_a_power_of_the_energy_and_below_the_lowest_angle_it_stays(tmp_path):
    flux = read_flux_table(write(tmp_path / "mine.csv", GOOD))
    middle = np.add(*flux.intensity(np.array(10**0.5), np.array(1.0)))
    assert middle == pytest.approx((14 * 1.4) ** 0.5)
    level = flux.intensity(np.array(3.0), np.array([0.0, 0.2, 0.5]))
    np.testing.assert_allclose(level, np.broadcast_to(np.array(level)[:, -1:], (2, 3)))


@pytest.mark.parametrize("text", [GOOD.replace(",", " "), GOOD.replace("\n", "\r\n"), "\ufeff" + GOOD])
def test_blanks_and_other_ends_of_lines_are_read_too(tmp_path, text):
    flux = read_flux_table(write(tmp_path / "mine.csv", text))
    assert np.add(*flux.intensity(np.array(1.0), np.array(1.0))) == pytest.approx(14)


def test_a_table_may_rise_or_fall_with_cos_zenith(tmp_path):
    energy, cosines = np.array([1.0, 3.0]), np.array([0.2, 0.6, 1.0])
    grid = np.arange(1.0, 13.0).reshape(3, 2, 2)
    rising = read_flux_table(write(tmp_path / "rising.csv", lines(energy, cosines, grid)))
    falling = read_flux_table(write(tmp_path / "falling.csv", lines(energy, cosines[::-1], grid[::-1])))
    at = np.array([1.0, 1.7, 2.9]), np.linspace(0, 1, 7)[:, None]
    np.testing.assert_allclose(rising.intensity(*at), falling.intensity(*at))


def test_a_table_of_ten_energies_a_decade_and_seventeen_angles_gives_the_flux_back(tmp_path):
    energy = np.geomspace(1e-3, 1e6, 91)
    cosines = np.cos(np.radians([0, 10, 20, 30, 40, 50, 60, 65, 70, 75, 80, 82, 84, 86, 87, 88, 90]))
    grid = np.stack(MEASURED.intensity(energy, cosines[:, None]), axis=-1)
    flux = read_flux_table(write(tmp_path / "mine.csv", lines(energy, cosines, grid)))
    cosine = np.linspace(0, 1, 101)[:, None]
    at = np.geomspace(1e-3, 1e6, 500), cosine
    off = np.add(*flux.intensity(*at)) / np.add(*MEASURED.intensity(*at)) - 1
    assert np.abs(off[cosine[:, 0] >= 0.1]).max() < 0.03
    assert np.abs(off).max() < 0.25  # in the last degrees, where angles are sparse and muons too


@given(arrays(float, (3, 4, 2), elements=st.floats(1e-30, 1e6)), st.floats(1e-3, 1e6), st.floats(0, 1))
def test_any_positive_table_gives_a_positive_flux(tmp_path_factory, grid, energy, cosine):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    flux = read_flux_table(write(path, lines([0.1, 1.0, 10.0, 100.0], [0.0, 0.3, 1.0], grid)))
    plus, minus = flux.intensity(np.array(energy), np.array(cosine))
    assert np.isfinite(plus + minus)
    assert min(plus, minus) >= 0
    assert grid.sum(axis=-1).min() * (1 - 1e-9) <= plus + minus <= grid.sum(axis=-1).max() * (1 + 1e-9)


def test_one_charge_may_be_missing(tmp_path):
    flux = read_flux_table(write(tmp_path / "mine.csv", "1,0,0,2\n2,0,0,1\n1,1,0,4\n2,1,0,3\n"))
    plus, minus = flux.intensity(np.array(1.5), np.array(0.5))
    assert plus == 0
    assert minus > 0


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("10,1,0.8,0.6", "10,1,-0.8,0.6", "line 4 has a negative flux: 10, 1, -0.8, 0.6"),
        ("10,1,0.8,0.6", "10,1,nan,0.6", "line 4 has a number that is not finite"),
        ("10,1,0.8,0.6", "10,1,much,0.6", "line 4: '10,1,much,0.6' is not four numbers"),
        ("10,1,0.8,0.6", "10,1,0.8", "line 4: '10,1,0.8' is not four numbers"),
        ("10,1,0.8,0.6", "10,1,0,0", "line 4 has a flux of 0 for both charges"),
        ("10,1,0.8,0.6\n", "", "every cos zenith needs the energies of the first"),
        ("10,0.5,0.4,0.2\n", "", "line 8: expected was 10 GeV at cos zenith 0.5, found 100 GeV at 0.5"),
        ("100,0.5,0.01,0.005\n", "", "line 8: the table ends at 10 GeV"),
        ("1,1,8,6\n10,1,0.8,0.6", "10,1,0.8,0.6\n1,1,8,6", "line 4: 1 GeV comes after 10 GeV: sort the energies"),
        ("1,0.5,2,2", "-1,0.5,2,2", "line 6 has an energy that is not above 0"),
        ("1,0.5,2,2", "1,1.5,2,2", "line 6 has a cos zenith outside 0 to 1"),
        ("1,1,8,6\n10,1,0.8,0.6\n100,1,0.008,0.004\n", "", "the values of cos zenith neither rise nor fall"),
        (",1,", ",0.9,", "ends at cos zenith 0.9: expected was a flux of vertical muons, at 1"),
        (GOOD, "", "has no line of four numbers"),
        (GOOD, "1,1,8,6\n1,0.5,2,2\n", "cos zenith 1 has one energy"),
    ],
)
def test_what_is_no_flux_is_refused_in_one_line(tmp_path, old, new, reason):
    assert old in GOOD
    with pytest.raises(RefusedError) as refusal:
        read_flux_table(write(tmp_path / "mine.csv", GOOD.replace(old, new)))
    assert reason in str(refusal.value)
    assert str(refusal.value).startswith(str(tmp_path / "mine.csv"))
    assert "\n" not in str(refusal.value)


def test_a_file_that_is_no_text_is_refused(tmp_path):
    (tmp_path / "mine.csv").write_bytes(bytes(range(256)))
    with pytest.raises(RefusedError, match="is no text"):
        read_flux_table(tmp_path / "mine.csv")
    with pytest.raises(RefusedError, match="can't be read: Is a directory"):
        read_flux_table(tmp_path)
