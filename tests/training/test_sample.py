from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.tiny_families import tiny_family
from support.tiny_models import tiny_model

from deepmuon_runtime import Box, Cuts, Generator, Plane, Sphere, write_muons
from deepmuon_runtime.errors import RefusedError
from deepmuon_runtime.model.baking import bake
from deepmuon_runtime.muon_file.reader import read_attributes
from deepmuon_runtime.muons import Muons
from deepmuon_training.data.cry import CRY_SHOWER_VARIANCE, HELD_OUT_CRY_MUONS, read_cry
from deepmuon_training.sample import Sample, read_sample, write_sample

pytestmark = pytest.mark.filterwarnings("ignore:.* below 1 MeV, and dropped")  # of six muons of CRY, for once, two are

MUONS = Muons.of([1.0, 0.002, 300.0], [0.0, 0.6, 0.0], [0.0, 0.0, -0.6], [-1.0, -0.8, -0.8], [13, -13, 13])

CRY = {
    "kinetic_energy": np.float32([1000.0, 0.5, 2.0, 3e6, 0.999, 1.0]),  # MeV
    "u": np.float32([0, 0.6, 0, 0, 0.6, 0]),
    "v": np.float32([0, 0, 0.6, 0, 0, 0.6]),
    "w": np.float32([-1, -0.8, -0.8, -1, -0.8, -0.8]),
    "charge": np.int8([1, 1, -1, -1, -1, 1]),
}


def assert_same(found: Sample, expected: Sample) -> None:
    for field in fields(Sample):
        if field.name != "muons":
            assert getattr(found, field.name) == getattr(expected, field.name), field.name
    for field in fields(Muons):
        np.testing.assert_array_equal(getattr(found.muons, field.name), getattr(expected.muons, field.name))


@pytest.fixture
def cry(tmp_path: Path) -> Path:
    path = tmp_path / "cry.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("muons")
        group.attrs["rate_hz_per_m2"], group.attrs["source"] = 120.0, "CRY 1.7"
        for name, column in CRY.items():
            group[name] = column
    return path


@pytest.mark.parametrize(
    "known",
    [
        {},
        {"provenance": ("made", "changed"), "medium": "G4_CONCRETE", "rate": 60.5, "rate_uncertainty": 0.2},
        {"smoothed": True},
        {"smoothed": False, "rate": 1.5},
        {"flux": "cry"},
    ],
)
def test_a_sample_comes_back_as_it_was_written(tmp_path, known):
    sample = Sample(MUONS, depth_m=10.0, source="the tests", **known)
    write_sample(tmp_path / "sample.h5", sample)
    assert_same(read_sample(tmp_path / "sample.h5"), sample)


@pytest.mark.parametrize(("of_model", "geant4s"), [("water", "G4_WATER"), ("rock", "standard_rock 2.65 g/cm3")])
def test_a_sample_names_its_medium_as_geant4_does(tmp_path, of_model, geant4s):
    write_sample(tmp_path / "sample.h5", Sample(MUONS, depth_m=10.0, source="a model", medium=of_model))
    assert read_sample(tmp_path / "sample.h5").medium == geant4s


@pytest.mark.parametrize(
    ("target", "reason"),
    [(None, "has muons through a sphere"), (Sphere(0.1), "has muons that hit a sphere"), (Box(1, 1, 1), "hit a box")],
)
def test_muons_of_a_sphere_or_a_body_are_no_sample_of_a_plane(tmp_path, target, reason):
    (tmp_path / "model.onnx").write_bytes(bake(tiny_family(), 50, 1))
    Generator.open(file=tmp_path / "model.onnx").write(tmp_path / "muons.h5", 10, target=target)
    with pytest.raises(RefusedError, match=rf"muons\.h5 .*{reason}, and a sample's cross a horizontal plane"):
        read_sample(tmp_path / "muons.h5")


def test_muons_on_a_rectangle_are_a_sample_with_the_rate_of_a_square_metre(tmp_path):
    (tmp_path / "model.onnx").write_bytes(tiny_model())
    Generator.open(file=tmp_path / "model.onnx").write(tmp_path / "muons.h5", 10, target=Plane(2, 4))
    sample = read_sample(tmp_path / "muons.h5")
    assert (sample.rate, sample.rate_uncertainty) == pytest.approx((55.5, 0.1))


def test_the_rate_on_a_rectangle_of_unknown_size_is_unknown(tmp_path):
    about = {"depth_m": 1.0, "medium": "rock", "target": "plane", "target_rate_hz": 5.0}
    write_muons(tmp_path / "muons.h5", MUONS, about)
    assert read_sample(tmp_path / "muons.h5").rate is None


def test_a_sample_says_within_which_cuts_its_muons_are(tmp_path):
    (tmp_path / "model.onnx").write_bytes(tiny_model())
    cuts = Cuts(energy_max=10, zenith_min=5.5)
    Generator.open(file=tmp_path / "model.onnx").write(tmp_path / "cut.h5", 100, seed=1, cuts=cuts)
    cut = read_sample(tmp_path / "cut.h5")
    assert cut.provenance[-1] == "cut: energy_max_gev 10, zenith_min_degrees 5.5"
    write_sample(tmp_path / "again.h5", cut)
    assert read_sample(tmp_path / "again.h5").provenance == cut.provenance


def test_muons_of_cry_say_whose_flux_they_are(cry):
    assert read_cry(cry).flux == "cry"


def test_what_is_unknown_is_left_out_of_the_file(tmp_path):
    write_sample(tmp_path / "sample.h5", Sample(MUONS, depth_m=10.0, source="the tests"))
    attributes = read_attributes(tmp_path / "sample.h5")
    assert {"rate_hz_per_m2", "rate_uncertainty_hz_per_m2", "smoothed", "live_time_s_m2"}.isdisjoint(attributes)
    assert attributes["count"] == 3


def test_a_sample_is_not_overwritten_unless_asked_for(tmp_path):
    path = tmp_path / "sample.h5"
    write_sample(path, Sample(MUONS, depth_m=10.0, source="first"))
    with pytest.raises(RefusedError, match="exists already"):
        write_sample(path, Sample(MUONS, depth_m=10.0, source="second"))
    write_sample(path, Sample(MUONS, depth_m=10.0, source="third"), overwrite=True)
    assert read_sample(path).source == "third"


def test_a_damaged_file_is_refused_as_a_whole_and_not_in_part(tmp_path):
    path = tmp_path / "sample.h5"
    write_sample(path, Sample(MUONS, depth_m=10.0, source="the tests"))
    with h5py.File(path, "r+") as file:
        file["muons/kinetic_energy"][1] *= 2
    with pytest.raises(RefusedError, match="is damaged: the column kinetic_energy is not what was written"):
        read_sample(path)
    assert len(read_sample(path, 0, 1)) == 1


def test_a_change_is_added_to_the_provenance():
    first = Sample(MUONS, depth_m=0.0, source="the tests", provenance=("made",), rate=100.0)
    second = first.then("halved", rate=50.0)
    assert (second.provenance, second.rate, second.muons) == (("made", "halved"), 50.0, MUONS)
    assert first.provenance == ("made",)
    assert len(second) == 3


def test_cry_is_read_in_gev_with_pdg_ids_and_without_muons_below_1_mev(cry):
    sample = read_cry(cry)
    np.testing.assert_allclose(sample.muons.kinetic_energy, [1.0, 2e-3, 3e3, 1e-3], rtol=1e-6)
    assert sample.muons.kinetic_energy.dtype == np.float32
    assert sample.muons.kinetic_energy.min() >= 1e-3
    np.testing.assert_array_equal(sample.muons.pdg_id, [-13, 13, 13, -13])
    np.testing.assert_array_equal(sample.muons.v, np.float32([0, 0.6, 0, 0.6]))
    assert (sample.depth_m, sample.source, sample.smoothed) == (0.0, "CRY 1.7", False)
    assert sample.provenance == ("CRY 1.7, rows 0 to 6, 2 below 1 MeV dropped",)


def test_crys_rate_is_that_of_the_muons_kept_and_knows_of_showers(cry):
    sample = read_cry(cry)
    assert sample.rate == pytest.approx(120.0 * 4 / 6)
    assert sample.rate_uncertainty == pytest.approx(120.0 * np.sqrt(CRY_SHOWER_VARIANCE / 6))


def test_training_and_held_out_rows_are_all_rows(cry):
    training, held_out = read_cry(cry, slice(-2)), read_cry(cry, slice(-2, None))
    both = Muons.concatenate([training.muons, held_out.muons])
    np.testing.assert_array_equal(both.kinetic_energy, read_cry(cry).muons.kinetic_energy)
    assert held_out.provenance == ("CRY 1.7, rows 4 to 6, 1 below 1 MeV dropped",)
    assert held_out.rate == pytest.approx(60.0)
    assert HELD_OUT_CRY_MUONS == 2_000_000


def test_rows_without_a_muon_are_refused(cry):
    with pytest.raises(RefusedError, match="no muon of at least 1 MeV in its rows 0 to 0"):
        read_cry(cry, slice(-HELD_OUT_CRY_MUONS))


def without(path: Path, name: str) -> None:
    with h5py.File(path, "r+") as file:
        del file["muons"][name]


@pytest.mark.parametrize("column", CRY)
def test_a_cry_file_that_lacks_a_column_is_refused(cry, column):
    without(cry, column)
    with pytest.raises(RefusedError, match="is no CRY sample"):
        read_cry(cry)


def wrong_files(folder: Path) -> dict[str, Path]:
    paths = {name: folder / name for name in ("missing", "text", "empty", "column", "folder")}
    paths["text"].write_text("muons")
    paths["folder"].mkdir()
    with h5py.File(paths["empty"], "w"):
        pass
    with h5py.File(paths["column"], "w") as file:
        file["muons"] = np.zeros(3)
    return paths


@pytest.mark.parametrize("kind", ["missing", "text", "empty", "column", "folder"])
@pytest.mark.parametrize("read", [read_cry, read_sample])
def test_a_file_of_another_kind_is_refused_in_one_line(tmp_path, read, kind):
    path = wrong_files(tmp_path)[kind]
    with pytest.raises(RefusedError) as refusal:
        read(path)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_crys_file_and_the_contracts_are_not_mistaken_for_each_other(cry, tmp_path):
    write_sample(tmp_path / "sample.h5", Sample(MUONS, depth_m=0.0, source="the tests"))
    with pytest.raises(RefusedError, match="is no CRY sample"):
        read_cry(tmp_path / "sample.h5")
    with pytest.raises(RefusedError, match="is no muon file"):
        read_sample(cry)


def test_a_part_of_a_sample_is_its_muons_with_all_that_is_known_of_them(tmp_path):
    sample = Sample(MUONS, depth_m=10.0, source="the tests", provenance=("made",), rate=60.5)
    write_sample(tmp_path / "sample.h5", sample)
    assert_same(read_sample(tmp_path / "sample.h5", 1, 2), replace(sample, muons=MUONS[1:]))


@pytest.mark.parametrize(
    ("column", "value", "reason"),
    [
        ("kinetic_energy", np.nan, "row 3: the muon has a kinetic energy that is negative or not finite"),
        ("kinetic_energy", -1, "row 3: the muon has a kinetic energy that is negative or not finite"),
        ("u", 0.1, "row 3: the muon has a direction whose length is not 1"),
        ("v", np.nan, "row 3: the muon has a direction whose length is not 1"),
        ("w", 1, "row 3: the muon does not go down"),
        ("charge", 0, "row 3: the muon has the charge 0"),
    ],
)
def test_a_row_of_crys_that_is_no_muon_is_named(cry, column, value, reason):
    with h5py.File(cry, "r+") as file:
        file["muons"][column][3] = value
    with pytest.raises(RefusedError, match=reason):
        read_cry(cry, slice(2, None))


@pytest.mark.parametrize(
    "column",
    [np.zeros(5, np.float32), np.zeros((6, 2)), np.array([b"a"] * 6), 1.0],
    ids=["short", "wide", "text", "one"],
)
def test_a_column_of_crys_of_another_shape_or_type_is_refused(cry, column):
    without(cry, "kinetic_energy")
    with h5py.File(cry, "r+") as file:
        file["muons/kinetic_energy"] = column
    with pytest.raises(RefusedError, match="is no CRY sample"):
        read_cry(cry)


@pytest.mark.parametrize("how", ["external storage", "a link", "no chunk"])
def test_a_column_of_crys_that_is_not_in_its_file_is_refused(cry, tmp_path, how):
    (tmp_path / "secret").write_bytes(b"pass" * 6)
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["u"] = CRY["u"]
    without(cry, "u")
    with h5py.File(cry, "r+") as file:
        if how == "external storage":
            file["muons"].create_dataset("u", (6,), "f4", external=[(str(tmp_path / "secret"), 0, 24)])
        elif how == "a link":
            file["muons"]["u"] = h5py.ExternalLink("other.h5", "/u")
        else:
            file["muons"].create_dataset("u", (6,), "f4", chunks=(2,))
    with pytest.raises(RefusedError, match=r"is no CRY sample .*column u"):
        read_cry(cry)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf, "fast"])
def test_a_rate_of_crys_that_is_none_is_refused(cry, rate):
    with h5py.File(cry, "r+") as file:
        file["muons"].attrs["rate_hz_per_m2"] = rate
    with pytest.raises(RefusedError, match="is no CRY sample"):
        read_cry(cry)
