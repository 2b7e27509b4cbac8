from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import deepmuon_training.data.foreign.npy_table
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.muons import Muons
from deepmuon_training.data.foreign.columns import Columns
from deepmuon_training.data.foreign.headings import columns_of
from deepmuon_training.data.foreign.npy_table import open_npy
from deepmuon_training.data.foreign.reading import read_foreign
from deepmuon_training.data.foreign.text_table import open_text

ROWS = np.array([[2150.0, 0.6, 0.0, -0.8, -1], [830.0, 0.0, -0.28, -0.96, 1], [0.5, 0.0, 0.0, -1.0, 1]])
UP = ROWS * [1, 1, 1, -1, 1]


def write_csv(path: Path, rows: np.ndarray) -> None:
    path.write_text("".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()), encoding="ascii")


READERS = {"csv": (write_csv, open_text), "npy": (np.save, open_npy)}


@pytest.fixture(params=READERS)
def read(request, tmp_path):
    """Write a table as either format, and read it."""
    write, reader = READERS[request.param]

    def run(rows: np.ndarray, names: str, unit: str = "MeV", angle: str | None = None) -> Muons:
        path = tmp_path / f"table.{request.param}"
        write(path, rows)
        table = reader(path)
        return read_foreign(table, columns_of(table, names, unit, angle)).muons

    return run


@pytest.mark.parametrize(
    ("rows", "names"),
    [
        (ROWS[:, :3], "E,u,v"),
        (ROWS[:, :4], "E,u,v,w"),
        (ROWS, "E,u,v,w,charge"),
        (ROWS * [1, 1, 1, 1, -13], "E,u,v,w,pdg_id"),
        (UP, "E,u,v,-w,charge"),
        (ROWS * [1, -1, -1, -1, 1], "E,-u,-v,-w,charge"),
        (ROWS[:, [4, 3, 2, 1, 0]], "charge,w,v,u,E"),
        (np.insert(ROWS, [0, 2], np.nan, axis=1), "skip,E,u,skip,v,w,charge"),
    ],
)
@pytest.mark.parametrize(("unit", "gev"), [("MeV", 1e-3), ("GeV", 1.0)])
def test_columns_are_what_they_are_said_to_be(read, rows, names, unit, gev):
    muons = read(rows, names, unit)
    np.testing.assert_allclose(muons.kinetic_energy, ROWS[:, 0] * gev, rtol=1e-6)
    np.testing.assert_allclose(np.stack([muons.u, muons.v, muons.w]).T, ROWS[:, 1:4], atol=1e-6)
    has_charge = Columns(names.split(","), unit).has_charge
    np.testing.assert_array_equal(muons.pdg_id, [13, -13, -13] if has_charge else [0, 0, 0])


def test_a_direction_of_three_digits_gets_length_1(read):
    muons = read(np.array([[1.0, 0.577, 0.577, -0.577]]), "E,u,v,w")
    np.testing.assert_allclose([muons.u[0], muons.v[0], muons.w[0]], [3**-0.5, 3**-0.5, -(3**-0.5)], rtol=1e-6)


def test_a_level_muon_of_two_cosines_goes_down_all_the_same(read):
    muons = read(np.array([[1.0, 0.6, 0.8], [1.0, 0.6, 0.800003]]), "E,u,v")
    assert np.all(muons.w < 0)
    assert np.all(muons.cos_zenith < 1e-3)


MASS = 0.1056583755


@pytest.mark.parametrize(
    ("names", "momentum"),
    [("Etot,u,v", lambda p: np.sqrt(p**2 + MASS**2)), ("p,u,v", lambda p: p)],
)
def test_total_energies_and_momenta_become_kinetic_energies(read, names, momentum):
    p = np.array([0.02, 1.0, 1e5])
    muons = read(np.stack([momentum(p) * 1e3, [0.6, 0.0, 0.1], [0.0, 0.28, 0.2]], axis=1), names)
    np.testing.assert_allclose(muons.kinetic_energy, np.hypot(p, MASS) - MASS, rtol=1e-6)


@pytest.mark.parametrize(("names", "sign"), [("px,py,pz", 1), ("px,py,-pz", [1, 1, -1]), ("-px,-py,-pz", -1)])
def test_the_components_of_a_momentum_are_energy_and_direction(read, names, sign):
    direction = np.array([[0.6, 0.0, -0.8], [0.0, -0.28, -0.96]])
    muons = read(direction * [[2.0], [300.0]] * sign, names, "GeV")
    np.testing.assert_allclose(np.stack([muons.u, muons.v, muons.w]).T, direction, atol=1e-7)
    np.testing.assert_allclose(muons.kinetic_energy, np.hypot([2.0, 300.0], MASS) - MASS, rtol=1e-6)


@pytest.mark.parametrize(("angle", "radian"), [("deg", 180 / np.pi), ("rad", 1.0)])
@pytest.mark.parametrize(
    ("names", "polar", "azimuth"),
    [
        ("E,theta,phi", lambda w: np.arccos(w), 0.0),
        ("E,theta,azimuth", lambda w: np.arccos(w), np.pi),
        ("E,zenith,phi", lambda w: np.arccos(-w), 0.0),
        ("E,zenith,azimuth", lambda w: np.arccos(-w), -np.pi),
    ],
)
def test_two_angles_are_a_direction(read, names, polar, azimuth, angle, radian):
    u, v, w = direction = np.array([[0.6, 0.0, -0.8], [0.0, -0.28, -0.96], [0.0, 0.0, -1.0]]).T
    rows = np.stack([[1.0, 2.0, 3.0], radian * polar(w), radian * (np.arctan2(v, u) + azimuth)], axis=1)
    muons = read(rows, names, "GeV", angle)
    np.testing.assert_allclose([muons.u, muons.v, muons.w], direction, atol=1e-6)


def test_a_cosine_of_the_zenith_angle_is_one_too(read):
    muons = read(np.array([[1.0, 0.8, 90.0], [1.0, 1.0, 0.0]]), "E,cos_zenith,phi", "GeV", "deg")
    np.testing.assert_allclose([muons.u, muons.v, muons.w], [[0.0, 0.0], [0.6, 0.0], [-0.8, -1.0]], atol=1e-6)


@pytest.mark.parametrize(
    ("kind", "minus", "plus", "other"),
    [("pdg_id", 13, -13, 11), ("corsika_id", 6, 5, 2), ("musun_id", 11, 10, 13), ("phits_id", 7, 6, 2)],
)
def test_particles_have_the_numbers_of_their_program(tmp_path, kind, minus, plus, other):
    rows = np.array([[1.0, 0.0, 0.0, plus], [2.0, 0.0, 0.0, minus], [np.nan, 1.0, 1.0, other], [4.0, 0.0, 0.0, minus]])
    np.save(tmp_path / "table.npy", rows)
    columns = Columns(("E", "u", "v", kind), "GeV")
    found = read_foreign(open_npy(tmp_path / "table.npy"), columns, muons_only=True)
    np.testing.assert_array_equal(found.muons.pdg_id, [-13, 13, 13])
    np.testing.assert_array_equal(found.muons.kinetic_energy, [1.0, 2.0, 4.0])
    assert found.left_out == [f"1 of 4 rows left out, which are no muons: 1 of {other}"]
    with pytest.raises(RefusedError, match=rf"row 2: {kind} {other} is no muon \(mu- is {minus}, mu\+ {plus}\)"):
        read_foreign(open_npy(tmp_path / "table.npy"), columns)
    np.save(tmp_path / "table.npy", rows[2:3])
    with pytest.raises(RefusedError, match=f"has no muon: {kind} is {other}"):
        read_foreign(open_npy(tmp_path / "table.npy"), columns, muons_only=True)


@pytest.mark.parametrize(
    ("names", "reason"),
    [
        ("E,u", "no column v"),
        ("u,v,w", "no column E"),
        ("", "no column ''"),
        ("E,u,v,w,q", "no column 'q'"),
        ("E,u,v,cos", "no column 'cos'"),
        ("E,u,v,v", "the column v is there twice"),
        ("E,u,v,w,-w", "the column w is there twice"),
        ("E,u,v,charge,pdg_id", "charge and pdg_id say the same"),
        ("E,u,v,pdg_id,musun_id", "pdg_id and musun_id say the same"),
        ("-E,u,v", "no column '-E'"),
        ("E,p,u,v", "E and p say the same, the energy"),
        ("E,px,py,pz", "E and px,py,pz say the same, the energy"),
        ("px,py", "no column pz"),
        ("E,theta", "no column phi: two angles make a direction"),
        ("E,phi,azimuth", "phi and azimuth say the same"),
        ("E,u,v,zenith", "the angles and u and v say the same, the direction"),
        ("px,py,pz,u,v", "u,v,w and px,py,pz say the same, the direction"),
    ],
)
def test_columns_that_are_no_muon_are_refused(names, reason):
    with pytest.raises(RefusedError, match=reason):
        Columns(names.split(","), "MeV")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({0: np.nan}, "kinetic energy that is negative or not finite"),
        ({0: -1.0}, "kinetic energy that is negative or not finite"),
        ({0: 1e300}, "kinetic energy that is negative or not finite"),
        ({1: np.nan}, "direction whose length is not 1"),
        ({1: np.inf}, "direction whose length is not 1"),
        ({1: 2150.0}, "direction whose length is not 1"),
        ({1: 0.0, 3: 0.0}, "direction whose length is not 1"),
        ({3: 0.8}, "does not go down"),
        ({1: 1.0, 3: 0.0}, "does not go down"),
        ({4: 0.0}, "the charge 0.0, which is neither -1 nor \\+1"),
        ({4: 13.0}, "the charge 13.0, which is neither -1 nor \\+1"),
        ({4: np.nan}, "the charge nan, which is neither -1 nor \\+1"),
    ],
)
def test_a_row_that_is_no_muon_is_named(read, change, reason):
    rows = ROWS[[0, 0, 0, 0]]
    for column, value in change.items():
        rows[2, column] = value
    with pytest.raises(RefusedError, match=r"table\.csv, line 3|table\.npy, row 2") as refusal:
        read(rows, "E,u,v,w,charge")
    assert refusal.match(reason)


def test_two_cosines_that_are_no_direction_are_named(read):
    with pytest.raises(RefusedError, match=r"(line 2|row 1): the muon has u\^2 \+ v\^2 = 1\.01"):
        read(np.array([[1.0, 0.6, 0.7], [1.0, 0.1, 1.0]]), "E,u,v")


@pytest.mark.parametrize(
    ("row", "names", "reason"),
    [
        ([0.1, 0.0, 0.0], "Etot,u,v", "a total energy of 0.1 GeV, below its mass"),
        ([-1.0, 0.0, 0.0], "p,u,v", "a momentum of -1 GeV/c, which is negative"),
        ([0.0, 0.0, 0.0], "px,py,pz", "a direction whose length is not 1"),
        ([0.0, 0.0, 1.0], "px,py,pz", "does not go down .*: -pz is a pz whose z axis points down"),
        ([1.0, 30.0, 0.0], "E,theta,phi", "does not go down .*: zenith is the angle"),
        ([1.0, 120.0, 0.0], "E,zenith,phi", "does not go down"),
        ([1.0, -3.0, 0.0], "E,zenith,phi", "a zenith of -3 deg, which is none of 0 to 180"),
        ([1.0, 181.0, 0.0], "E,theta,phi", "a theta of 181 deg, which is none of 0 to 180"),
        ([1.0, 1.1, 0.0], "E,cos_zenith,phi", "a cos_zenith of 1.1"),
        ([1.0, np.nan, 0.0], "E,zenith,phi", "a direction whose length is not 1"),
        ([1.0, 30.0, np.inf], "E,zenith,phi", "a direction whose length is not 1"),
    ],
)
def test_numbers_that_make_no_muon_are_named(read, row, names, reason):
    with pytest.raises(RefusedError, match=rf"(line 1|row 0): the muon .*{reason}"):
        read(np.array([row]), names, "GeV", "deg" if "phi" in names else None)


def test_degrees_that_are_called_radian_are_refused_with_a_question(read):
    with pytest.raises(RefusedError, match=r"a zenith of 30 rad, .*: are the angles in degrees"):
        read(np.array([[1.0, 30.0, 0.0]]), "E,zenith,phi", "GeV", "rad")


@pytest.mark.parametrize(
    ("energy", "zenith", "doubt"),
    [
        (4000.0, 30.0, ["half of the muons have more than 1 TeV: are the energies in MeV, and not in GeV?"]),
        (4.0, 1.5, ["no muon is further from the vertical than 1.6 degrees: are the angles in rad, and not in deg?"]),
        (4.0, 2.0, []),
        (900.0, 30.0, []),
    ],
)
def test_units_that_can_hardly_be_meant_are_doubted(energy, zenith, doubt):
    rows = np.linspace([energy, 0.0, 0.0], [energy, zenith, 90.0], 20)
    columns = Columns(("E", "zenith", "phi"), "GeV", "deg")
    assert list(columns.doubts(columns.muons(rows, str))) == doubt


@pytest.mark.parametrize("names", ["E,u,v", "E,u,v,w", "E,u,v,w,charge,skip"])
def test_another_number_of_columns_is_refused(read, names):
    with pytest.raises(RefusedError, match=rf"has 5 columns, and --columns names {names.count(',') + 1}"):
        read(ROWS, names)


def test_rows_are_counted_through_all_pieces_of_an_npy(tmp_path, monkeypatch):
    monkeypatch.setattr(deepmuon_training.data.foreign.npy_table, "PIECE", 4)
    path, rows = tmp_path / "table.npy", np.repeat(ROWS, 4, axis=0)
    np.save(path, rows)
    columns = Columns(["E", "u", "v", "w", "charge"], "GeV")
    found = read_foreign(open_npy(path), columns).muons
    np.testing.assert_array_equal(found.kinetic_energy, rows[:, 0].astype(np.float32))
    rows[9, 3] = 1.0
    np.save(path, rows)
    with pytest.raises(RefusedError, match="row 9: the muon does not go down"):
        read_foreign(open_npy(path), columns)


def npy_of(array: np.ndarray):
    return lambda path: np.save(path, array, allow_pickle=True)


def cut(path: Path) -> None:
    np.save(path, ROWS[:, :3])
    path.write_bytes(path.read_bytes()[:-8])


def npz(path: Path) -> None:
    with path.open("wb") as file:
        np.savez(file, ROWS)


WRONG_NPY = {
    "missing": (lambda path: None, "No such file"),
    "folder": (Path.mkdir, "Is a directory"),
    "empty": (lambda path: path.write_bytes(b""), "can't be read as an NPY file"),
    "text": (lambda path: path.write_text("1,2,3\n"), "can't be read as an NPY file"),
    "cut": (cut, "can't be read as an NPY file"),
    "pickle": (lambda path: path.write_bytes(pickle.dumps(ROWS)), "can't be read as an NPY file"),
    "objects": (npy_of(ROWS[:, :3].astype(object)), "can't be read as an NPY file"),
    "npz": (npz, "can't be read as an NPY file"),
    "integers": (npy_of(np.ones((2, 3), int)), "the shape \\(2, 3\\) and the type int64"),
    "complex": (npy_of(np.ones((2, 3), complex)), "the type complex128"),
    "texts": (npy_of(np.full((2, 3), "a")), "the type <U1"),
    "fields": (npy_of(np.zeros(2, dtype=[("E", float), ("u", float), ("v", float)])), "the shape \\(2,\\)"),
    "one": (npy_of(np.ones(3)), "the shape \\(3,\\)"),
    "scalar": (npy_of(np.array(1.0)), "the shape \\(\\)"),
    "no rows": (npy_of(np.ones((0, 3))), "has no row"),
}


@pytest.mark.parametrize("kind", WRONG_NPY)
def test_what_is_no_table_of_numbers_is_refused(tmp_path, kind):
    write, reason = WRONG_NPY[kind]
    path = tmp_path / "table.npy"
    write(path)
    with pytest.raises(RefusedError, match=reason) as refusal:
        open_npy(path)
    assert "\n" not in str(refusal.value)


COSINES = st.floats(-0.7, 0.7)


@pytest.mark.parametrize("kind", READERS)
@given(rows=arrays(float, st.tuples(st.integers(1, 30), st.just(3)), elements=COSINES), scale=st.floats(1, 1e5))
def test_any_cosines_come_back(tmp_path_factory, kind, rows, scale):
    write, reader = READERS[kind]
    path = tmp_path_factory.mktemp("table") / f"table.{kind}"
    rows[:, 0] = np.abs(rows[:, 0]) * scale
    write(path, rows)
    muons = read_foreign(reader(path), Columns(["E", "u", "v"], "GeV")).muons
    np.testing.assert_allclose(muons.kinetic_energy, rows[:, 0].astype(np.float32), rtol=1e-6)
    np.testing.assert_allclose(np.stack([muons.u, muons.v]).T, rows[:, 1:], atol=1e-7)
    np.testing.assert_allclose(muons.u**2 + muons.v**2 + muons.w**2, 1, atol=1e-6)
