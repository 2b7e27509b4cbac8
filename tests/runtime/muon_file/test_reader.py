"""What a stranger's or a damaged file does to those who read it: the same for each of them."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.muon_files import sign, sign_attributes, write_version_1

from deepmuon_runtime import Muons, RefusedError, check_file, read_attributes, read_muons, write_muons
from deepmuon_runtime.formats.registry import opened_muons
from deepmuon_runtime.muon_file.reader import opened, read_pieces, verify_muons
from deepmuon_runtime.muon_file.writer import MuonWriter
from deepmuon_runtime.views.spectra import count_spectra

N = 3000
COLUMNS = ("kinetic_energy", "u", "v", "w", "pdg_id")
ABOUT = {"depth_m": 10.0, "medium": "G4_WATER", "source": "a test", "provenance": ["made"]}

READERS: dict[str, Callable[[Path], object]] = {
    "read_muons": read_muons,
    "read_pieces": lambda path: list(read_pieces(path, 1000)),
    "verify_muons": verify_muons,
    "opened_muons": lambda path: read_all(path),
    "count_spectra": count_spectra,
    "refer": lambda path: refer(path, path.with_suffix(".virtual")),
}


def some_muons(n: int = N) -> Muons:
    random = np.random.default_rng(n)
    w = -np.sqrt(random.uniform(0.1, 1, n))
    return Muons.of(random.uniform(0.2, 2, n), np.sqrt(1 - w**2), np.zeros(n), w, random.choice([13, -13], n))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_muons(tmp_path / "muons.h5", some_muons(), ABOUT)
    return tmp_path / "muons.h5"


def read_all(path: Path) -> None:
    with opened_muons(path) as source:
        list(source.pieces())


def refer(path: Path, target: Path) -> None:
    with MuonWriter(target, ABOUT) as writer:
        writer.refer([path])
    verify_muons(target)


def keep_outside(muons: h5py.Group) -> None:
    """Take the energies from a file of somebody else."""
    secret = Path(muons.file.filename).with_name("secret")
    secret.write_bytes(b"password" * N)
    replace(muons, "kinetic_energy", shape=(N,), dtype="f4", external=[(str(secret), 0, 4 * N)])


def replace(muons: h5py.Group, name: str, **description: object) -> None:
    attributes = dict(muons[name].attrs)
    del muons[name]
    muons.create_dataset(name, **description).attrs.update(attributes)


def other_file(muons: h5py.Group) -> str:
    """Write a file beside that of the muons which has such a column, and return its name."""
    with h5py.File(Path(muons.file.filename).with_name("other.h5"), "w") as file:
        file["muons/u"] = muons["u"][:]
    return "other.h5"


def link_out(muons: h5py.Group) -> None:
    link = h5py.ExternalLink(other_file(muons), "/muons/u")
    del muons["u"]
    muons["u"] = link


def link_out_by_a_soft_link(muons: h5py.Group) -> None:
    muons.file["there"] = h5py.ExternalLink(other_file(muons), "/muons")
    del muons["u"]
    muons["u"] = h5py.SoftLink("/there/u")


def link_all_out(muons: h5py.Group) -> None:
    file = muons.file
    file.move("muons", "there")
    file["muons"] = h5py.ExternalLink(other_file(file["there"]), "/muons")


def map_out(source: Callable[[h5py.Group], str]) -> Callable[[h5py.Group], None]:
    def change(muons: h5py.Group) -> None:
        layout = h5py.VirtualLayout((N,), "<f4")
        layout[:] = h5py.VirtualSource(source(muons), "muons/u", (N,))
        attributes = dict(muons["u"].attrs)
        del muons["u"]
        muons.create_virtual_dataset("u", layout).attrs.update(attributes)

    return change


def pipe(muons: h5py.Group) -> str:
    os.mkfifo(Path(muons.file.filename).with_name("pipe"))
    return "pipe"


def absolute(muons: h5py.Group) -> str:
    path = Path(muons.file.filename).with_name("good.h5")
    write_muons(path, some_muons(), ABOUT)
    return str(path)


HOSTILE: dict[str, tuple[Callable[[h5py.Group], object], str]] = {
    "a column in another file": (keep_outside, "keeps its numbers in a file that is not HDF5"),
    "a link to another file": (link_out, "lacks the column u"),
    "a soft link to another file": (link_out_by_a_soft_link, "lacks the column u"),
    "a link to another group": (link_all_out, "has no group /muons"),
    "a virtual column of a pipe": (map_out(pipe), "pipe is missing|keeps its muons in other files"),
    "a virtual column of no muon file": (map_out(other_file), "is no muon file|keeps its muons in other files"),
    "a virtual column by an absolute path": (map_out(absolute), "is not named by a path relative to the folder"),
    "a missing chunk": (
        lambda muons: replace(muons, "u", shape=(N,), dtype="f4", chunks=(1000,)),
        "u holds 0 of its 3 chunks",
    ),
    "chunks of gigabytes": (
        lambda muons: replace(muons, "u", shape=(N,), maxshape=(None,), dtype="f4", chunks=(1 << 29,)),
        "u is stored in chunks of more than 67108864 bytes",
    ),
    "other units": (lambda muons: muons["kinetic_energy"].attrs.__setitem__("units", "MeV"), "has the units 'MeV'"),
    "no checksum": (lambda muons: muons["u"].attrs.__delitem__("crc32"), "has the checksum None"),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("how", HOSTILE)
def test_a_file_that_leads_out_of_itself_or_lacks_what_it_says_is_refused_by_every_reader(path, reader, how):
    change, expected = HOSTILE[how]
    with h5py.File(path, "r+") as file:
        change(file["muons"])
    with pytest.raises(RefusedError, match=expected) as refusal:
        READERS[reader](path)
    assert "\n" not in str(refusal.value)
    assert check_file(path).defects


def test_an_absurd_count_is_refused_before_memory_is_asked_for(path):
    with h5py.File(path, "r+") as file:
        for name in COLUMNS:
            dtype = file["muons"][name].dtype
            replace(file["muons"], name, shape=(1 << 44,), dtype=dtype)
        file["muons"].attrs["count"] = 1 << 44
        sign_attributes(file["muons"])
    with pytest.raises(RefusedError, match="holds 0 of its 70368744177664 bytes"):
        read_muons(path)


def test_more_muons_than_the_memory_holds_are_refused_before_they_are_read(path, monkeypatch):
    monkeypatch.setattr(os, "sysconf", lambda name: {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 12}[name])
    with pytest.raises(RefusedError, match=r"3,000 muons of .*muons\.h5 do not fit in the 49.2 kB of memory: read"):
        read_muons(path)
    assert len(read_muons(path, 0, 2000)) == 2000


@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_what_is_no_file_is_refused_and_not_waited_for(tmp_path, kind):
    """In a process of its own, which would never end."""
    if kind == "pipe":
        os.mkfifo(tmp_path / "pipe")
    path = {"pipe": tmp_path / "pipe", "device": "/dev/zero", "folder": tmp_path}[kind]
    program = f"""
        from deepmuon_runtime import RefusedError, check_file, read_attributes, read_muons
        for read in (read_muons, read_attributes, check_file):
            try:
                read({str(path)!r})
            except RefusedError as error:
                print(error)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, timeout=120)
    expected = f"{path} can't be read as a muon file: it is a folder, a pipe or a device\n"
    assert (done.stdout, done.stderr) == (3 * expected, "")


@pytest.mark.parametrize("name", ["a" * 300, "a\0b"])
def test_a_name_that_no_file_can_have_is_refused_in_one_line(name):
    for read in (read_muons, check_file):
        with pytest.raises(RefusedError, match="can't be read as a muon file: "):
            read(name)


def change_muon(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file["muons/kinetic_energy"][7] = 1.5


@pytest.mark.parametrize("reader", READERS)
def test_who_reads_all_muons_refuses_damaged_ones(path, reader):
    change_muon(path)
    with pytest.raises(RefusedError, match=r"is damaged: the column kinetic_energy .*is not what was written"):
        READERS[reader](path)


def test_a_part_can_not_be_verified(path):
    change_muon(path)
    assert len(read_muons(path, 0, N - 1)) == N - 1


@pytest.mark.parametrize("reader", [*READERS, "a part"])
def test_changed_attributes_are_refused_by_every_reader(path, reader):
    with h5py.File(path, "r+") as file:
        file["muons"].attrs["depth_m"] = 11.0
    readers = {**READERS, "a part": lambda path: read_muons(path, 0, 1)}
    with pytest.raises(RefusedError, match="is damaged: what the attributes say is not what was written: its CRC-32"):
        readers[reader](path)
    assert any("what the attributes say is not" in defect for defect in check_file(path).defects)


@pytest.mark.parametrize("how", ["taken away", "of another type"])
def test_a_file_of_version_2_has_a_checksum_of_its_attributes(path, how):
    with h5py.File(path, "r+") as file:
        del file["muons"].attrs["attributes_crc32"]
        if how == "of another type":
            file["muons"].attrs["attributes_crc32"] = "0"
    with pytest.raises(RefusedError, match="attribute attributes_crc32 is "):
        read_muons(path)
    (defect,) = check_file(path).defects
    assert defect.startswith("the attribute attributes_crc32 is ")


def test_any_changed_byte_of_an_attribute_is_found(path):
    """Of the texts and numbers themselves; HDF5 has no other place for them."""
    content = path.read_bytes()
    with h5py.File(path) as file:
        created = file["muons"].attrs["created"].encode()
    for value in (b"G4_WATER", created, np.float64(10).tobytes(), b"a test"):
        assert content.count(value) == 1
        damaged = bytearray(content)
        damaged[content.index(value) + len(value) // 2] ^= 1
        path.write_bytes(damaged)
        with pytest.raises(RefusedError, match=r"muons\.h5.* is damaged: what the attributes say is not"):
            read_attributes(path)


VALUES = (
    st.text(st.characters(blacklist_categories=["Cs"], blacklist_characters="\0"))
    | st.integers(-(2**63), 2**64 - 1)
    | st.booleans()
    | st.floats()
    | st.lists(st.text("aµ", max_size=3), max_size=3)
    | st.lists(st.floats(), min_size=1, max_size=3)
)


@settings(deadline=None, max_examples=50)
@given(remarks=st.dictionaries(st.text("abcµ_", min_size=1, max_size=4), VALUES, max_size=4))
def test_the_checksum_of_the_attributes_is_what_the_format_says(tmp_path_factory, remarks):
    path = tmp_path_factory.mktemp("muons") / "muons.h5"
    write_muons(path, some_muons(3), {**ABOUT, **remarks})
    with h5py.File(path, "r+") as file:
        written = file["muons"].attrs["attributes_crc32"]
        sign_attributes(file["muons"])
        assert file["muons"].attrs["attributes_crc32"] == written
    np.testing.assert_equal({name: read_attributes(path)[name] for name in remarks}, remarks)


@pytest.mark.parametrize(
    ("attributes", "reason"),
    [
        ({"depth_m": "ten"}, "the attribute depth_m is 'ten', and should be a finite number from 0 on"),
        ({"rate_hz_per_m2": -1.0}, "the attribute rate_hz_per_m2 is -1.0, and should be a finite number from 0 on"),
        ({"remark": None}, "the attribute remark is None, and should be a text, a number, true or false, or a list"),
        ({"remark": 1j}, "the attribute remark is 1j, and should be a text"),
    ],
)
def test_attributes_that_no_reader_would_take_are_not_written(tmp_path, attributes, reason):
    with pytest.raises(RefusedError, match="was not written: " + reason):
        write_muons(tmp_path / "muons.h5", some_muons(), {**ABOUT, **attributes})
    assert not any(tmp_path.iterdir())


def test_what_hdf5_can_not_hold_in_a_text_is_escaped(tmp_path):
    write_muons(tmp_path / "muons.h5", some_muons(), {**ABOUT, "source": "a\0b\udcff", "provenance": ["\0", "c"]})
    found = read_attributes(tmp_path / "muons.h5")
    assert (found["source"], found["provenance"]) == (r"a\x00b\udcff", [r"\x00", "c"])


V1 = {
    "count": N,
    "depth_m": 10.0,
    "medium": "G4_WATER",
    "created": "2025-12-31T23:59:59+00:00",
    "created_by": "deepmuon-runtime 0.1.0",
    "source": "a test",
    "provenance": ["made"],
    "smoothed": True,
    "rate_hz_per_m2": 50.0,
    "live_time_s_m2": N / 50.0,
}


def test_a_file_of_version_1_is_read_as_before(tmp_path):
    path, muons = tmp_path / "old.h5", some_muons()
    write_version_1(path, muons, V1)
    assert check_file(path).defects == []
    assert read_attributes(path) == V1
    for found in (read_muons(path), Muons.concatenate(list(read_pieces(path, 1000)))):
        assert all(np.array_equal(getattr(found, name), getattr(muons, name)) for name in COLUMNS)
    refer(path, tmp_path / "virtual.h5")
    change_muon(path)
    with pytest.raises(RefusedError, match="is damaged: the column kinetic_energy"):
        read_muons(path)


def test_what_a_file_of_version_1_has_beside_its_columns_is_not_looked_at(tmp_path):
    write_version_1(tmp_path / "old.h5", some_muons(), V1)
    with h5py.File(tmp_path / "old.h5", "r+") as file:
        file["muons/time"] = np.zeros(3, "f4")
    assert len(read_muons(tmp_path / "old.h5")) == N
    assert check_file(tmp_path / "old.h5").defects == []


def write_with_places_and_times(path: Path, **attributes: object) -> dict[str, np.ndarray]:
    random = np.random.default_rng(1)
    columns = {
        **some_muons().columns,
        **{name: random.uniform(-2, 2, N).astype(np.float32) for name in "xy"},
        "z": np.full(N, 1.5, np.float32),  # the top of a box 3 m high
        "time": np.sort(random.uniform(0, 60, N)),
    }
    with MuonWriter(path, {**ABOUT, **attributes}, optional=("x", "y", "z", "time")) as writer:
        for first in range(0, N, 1100):
            writer.append_columns({name: column[first : first + 1100] for name, column in columns.items()})
    return columns


def test_places_and_times_are_kept_and_checked(tmp_path):
    columns = write_with_places_and_times(
        tmp_path / "muons.h5",
        live_time_s=60.0,
        target="box",
        target_size_m=[4.0, 4.0, 3.0],
        target_rate_hz=50.0,
        flux="cry",
        surface=1,
        energy_min_gev=0.2,
        energy_max_gev=2.0,
        zenith_max_degrees=80.0,
        fraction_kept=0.5,
    )
    assert check_file(tmp_path / "muons.h5").defects == []
    muons = read_muons(tmp_path / "muons.h5")
    assert all(np.array_equal(column, columns[name]) for name, column in muons.columns.items())
    assert read_attributes(tmp_path / "muons.h5")["target_live_time_s"] == N / 50.0
    with opened(tmp_path / "muons.h5") as file:
        found = file.read(0, N, file.columns)
    assert found.keys() == columns.keys()
    assert all(np.array_equal(found[name], column) for name, column in columns.items())


def test_a_time_after_the_live_time_is_a_defect(tmp_path):
    write_with_places_and_times(tmp_path / "muons.h5", live_time_s=30.0, target="a barn")
    (defect,) = check_file(tmp_path / "muons.h5").defects
    assert "comes after the live time of 30 s" in defect


def test_a_damaged_time_is_found_by_who_reads_it(tmp_path):
    path = tmp_path / "muons.h5"
    write_with_places_and_times(path)
    with h5py.File(path, "r+") as file:
        file["muons/time"][-1] += 1
    assert len(read_muons(path, count=N - 1)) == N - 1  # no checksum is of a part
    for read in (read_muons, verify_muons):
        with pytest.raises(RefusedError, match="the column time is not what was written"):
            read(path)


def test_a_part_of_a_place_is_refused(path):
    with h5py.File(path, "r+") as file:
        file["muons/x"] = np.zeros(N, "f4")
        file["muons/x"].attrs["units"] = "m"
        sign(file["muons"])
    with pytest.raises(RefusedError, match="lacks the column y"):
        read_muons(path)
