from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import sysconfig
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.commands import with_models
from support.muon_files import sign
from support.thorough import TIMES
from support.tiny_families import tiny_family
from support.tiny_models import release, tiny_model

from deepmuon_runtime import Cuts, Generator, Muons, Plane, write_muons

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-check"
MANY = Path(__file__).parents[1] / "support" / "run_many.py"
MUONS = 1000
LONGEST = 600  # s, on any machine


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """Variables of a process for which the small model is a released one."""
    folder = tmp_path_factory.mktemp("released")
    release(folder, {"quantile-10m.onnx": tiny_model(), "quantile-water.onnx": tiny_family()})
    return with_models(folder)


@pytest.fixture
def check(environment):
    """Run the installed command: exit code, lines of stdout, stderr."""

    def run(path: object) -> tuple[int, list[str], str]:
        done = subprocess.run([COMMAND, str(path)], env=environment, capture_output=True, text=True, timeout=LONGEST)
        return done.returncode, done.stdout.splitlines(), done.stderr

    return run


@pytest.fixture
def good_file(tmp_path, model_file) -> Path:
    path = tmp_path / "muons.h5"
    Generator.open(file=model_file, device="cpu").write(path, MUONS, seed=7)
    return path


def defects(lines: list[str]) -> list[str]:
    return [line.removeprefix("defect: ") for line in lines if line.startswith("defect: ")]


def test_a_good_file_is_summed_up(check, good_file):
    code, lines, err = check(good_file)
    assert (code, err) == (0, "")
    with h5py.File(good_file) as file:
        energy, w, pdg_id = (file["muons"][name][:].astype(float) for name in ("kinetic_energy", "w", "pdg_id"))
        sha256 = file["muons"].attrs["model_sha256"]
    assert lines == [
        f"{good_file}: 1,000 muons examined",
        "  depth               10 m of G4_WATER",
        f"  mean kinetic energy {energy.mean():.4g} GeV",
        f"  mean cos zenith     {-w.mean():.4f}",
        f"  mu+ / mu-           {(pdg_id == -13).sum() / (pdg_id == 13).sum():.4f}",
        "  rate                55.5 +- 0.1 per m2 and s",
        "  live time           18.0 s for 1 m2",
        "  seed                7",
        "  shard               1/1, from muon 0 of 1,000",
        f"  model               the released quantile-10m.onnx, SHA-256 {sha256}",
        "no defects found",
    ]


def test_a_rate_deep_below_is_not_rounded_to_nothing(check, tmp_path):
    model = tmp_path / "deep.onnx"
    model.write_bytes(tiny_model(metadata={"rate_hz_per_m2": "1.4253e-4", "rate_uncertainty_hz_per_m2": "1.5e-7"}))
    Generator.open(file=model).write(tmp_path / "muons.h5", 10)
    code, lines, _ = check(tmp_path / "muons.h5")
    assert code == 0
    assert "  rate                0.00014253 +- 1.5e-07 per m2 and s" in lines


def test_target_cuts_rate_and_times_are_summed_up(check, tmp_path, model_file):
    path = tmp_path / "muons.mcpl"
    generator, target, cuts = Generator.open(file=model_file, device="cpu"), Plane(2, 0.5), Cuts(0.5, 10, zenith_max=60)
    generator.write(path, seed=7, cuts=cuts, target=target, live_time=30)
    rate = generator.rate(cuts=cuts, target=target)
    code, lines, err = check(path)
    assert (code, err) == (0, "")
    for line in (
        "target              plane of 2 x 0.5 m",
        "cuts                kinetic energy from 0.5 GeV, kinetic energy to 10 GeV, zenith angle to 60 degrees, "
        f"{generator.fraction_kept(cuts, target):.4g} of all muons",
        f"rate                {rate.hz:.5g} +- {rate.uncertainty:.2g} per s",
        "times               of a run of 30 s",
    ):
        assert f"  {line}" in lines


def test_a_target_that_can_t_stand_in_a_line_is_a_defect(check, good_file):
    with h5py.File(good_file, "r+") as file:
        file["muons"].attrs["target"] = "box\nno defects found"
        sign(file["muons"])
    code, lines, err = check(good_file)
    assert (code, err) == (3, "")
    assert defects(lines) == [r"the attribute target is 'box\nno defects found', and should be a name"]
    assert "no defects found" not in lines


def test_a_model_of_ones_own_is_no_defect_and_named_as_such(check, tmp_path):
    model = tmp_path / "own.onnx"
    model.write_bytes(tiny_model(metadata={"depth_m": "12.5", "rate_hz_per_m2": None}))
    Generator.open(file=model).write(tmp_path / "muons.h5", 10)
    code, lines, _ = check(tmp_path / "muons.h5")
    assert code == 0
    assert "  depth               12.5 m of G4_WATER" in lines
    assert any(line.startswith("  model               none of the released ones, SHA-256 ") for line in lines)


@pytest.fixture
def of_a_family(tmp_path, family_file) -> Path:
    Generator.open(13.7, file=family_file, device="cpu").write(tmp_path / "family.h5", 100, seed=1)
    return tmp_path / "family.h5"


def test_muons_of_a_family_are_those_of_a_released_model_whatever_their_depth(check, of_a_family):
    code, lines, _ = check(of_a_family)
    assert code == 0
    assert "  depth               13.7 m of water" in lines
    assert "  flux at sea level   test" in lines
    assert "  rate                82.6 +- 0.17 per m2 and s" in lines
    assert any(line.startswith("  model               the released quantile-water.onnx, SHA-256 ") for line in lines)


@pytest.mark.parametrize(
    ("name", "value", "defect"),
    [
        ("depth_m", 100.5, "depth_m is 100.5, and its model quantile-water.onnx has 0 to 100"),
        ("depth_m", 20.0, "rate_hz_per_m2 is 82.6, and that of its model quantile-water.onnx is 70.0"),
        ("rate_hz_per_m2", 82.7, "rate_hz_per_m2 is 82.7, and that of its model quantile-water.onnx is 82.6"),
        ("medium", "rock", "medium is 'rock', and that of its model quantile-water.onnx is 'water'"),
        ("flux", "measured", "flux is 'measured', and that of its model quantile-water.onnx is 'test'"),
    ],
)
def test_what_a_family_could_not_have_made_is_a_defect(check, of_a_family, name, value, defect):
    with h5py.File(of_a_family, "r+") as file:
        file["muons"].attrs[name] = value
        sign(file["muons"])
    code, lines, _ = check(of_a_family)
    assert code == 3
    assert f"the attribute {defect}" in defects(lines)


def test_muons_of_other_origin_are_checked_too(check, tmp_path):
    one = np.ones(3)
    muons = Muons.of(1e6 * one, 0 * one, 0 * one, -one, [13, -13, 13])
    about = {"depth_m": 0.0, "medium": "G4_WATER", "source": "a test", "provenance": ["made up"]}
    write_muons(tmp_path / "muons.h5", muons, about)
    assert check(tmp_path / "muons.h5")[0] == 0


@pytest.mark.parametrize("n", [0, 1, 300_000])
def test_any_number_of_muons_is_good(check, tmp_path, model_file, n):
    Generator.open(file=model_file).write(tmp_path / "muons.h5", n, seed=1)
    code, lines, _ = check(tmp_path / "muons.h5")
    assert (code, lines[0]) == (0, f"{tmp_path}/muons.h5: {n:,} muons examined")


Damage = Callable[[h5py.Group], None]


def set_muon(column: str, index: int, value: float) -> Damage:
    def damage(muons: h5py.Group) -> None:
        muons[column][index] = value

    return damage


def set_attribute(name: str, value: object) -> Damage:
    def damage(muons: h5py.Group) -> None:
        muons.attrs[name] = value

    return damage


def delete_attribute(name: str) -> Damage:
    return lambda muons: muons.attrs.__delitem__(name)


def replace_column(name: str, **description: object) -> Damage:
    def damage(muons: h5py.Group) -> None:
        del muons[name]
        muons.create_dataset(name, **description).attrs["units"] = "1"

    return damage


def set_column_attribute(name: str, value: object) -> Damage:
    def damage(muons: h5py.Group) -> None:
        muons["u"].attrs[name] = value

    return damage


def shorten(muons: h5py.Group) -> None:
    muons["u"].resize((MUONS - 1,))


def shorten_all(muons: h5py.Group) -> None:
    for column in muons.values():
        column.resize((MUONS - 1,))


def take_units(muons: h5py.Group) -> None:
    del muons["kinetic_energy"].attrs["units"]


def delete_column(muons: h5py.Group) -> None:
    del muons["w"]


def group_for_a_column(muons: h5py.Group) -> None:
    del muons["w"]
    muons.create_group("w")


def link_to_another_file(muons: h5py.Group) -> None:
    del muons["v"]
    muons["v"] = h5py.ExternalLink("other.h5", "/muons/v")


def soft_link_to_another_file(muons: h5py.Group) -> None:
    del muons["v"]
    muons.file["other"] = h5py.ExternalLink("other.h5", "/muons")
    muons["v"] = h5py.SoftLink("/other/v")


def virtual_column(muons: h5py.Group) -> None:
    layout = h5py.VirtualLayout((MUONS,), "<f4")
    layout[:] = h5py.VirtualSource("other.h5", "/muons/v", (MUONS,))
    del muons["v"]
    muons.create_virtual_dataset("v", layout).attrs["units"] = "1"


def absolute_source(muons: h5py.Group) -> None:
    layout = h5py.VirtualLayout((MUONS,), "<f4")
    layout[:] = h5py.VirtualSource("/other.h5", "/muons/v", (MUONS,))
    del muons["v"]
    muons.create_virtual_dataset("v", layout).attrs["units"] = "1"


def other_column_as_source(muons: h5py.Group) -> None:
    layout = h5py.VirtualLayout((MUONS,), "<f4")
    layout[:] = h5py.VirtualSource("other.h5", "/muons/u", (MUONS,))
    del muons["v"]
    muons.create_virtual_dataset("v", layout).attrs["units"] = "1"


def add_places_and_times(**spoilt: object) -> Damage:
    def damage(muons: h5py.Group) -> None:
        columns = {name: np.zeros(MUONS, "f4") for name in "xyz"} | {"time": np.arange(MUONS, dtype=float)}
        for name, values in (columns | spoilt).items():
            if values is not None:
                muons.create_dataset(name, data=values).attrs["units"] = "s" if name == "time" else "m"

    return damage


def one_bad(value: float, dtype: str) -> np.ndarray:
    values = np.zeros(MUONS, dtype)
    values[500] = value
    return values


def several(muons: h5py.Group) -> None:
    muons["kinetic_energy"][3] = -1
    muons["w"][5:8] = np.nan
    del muons.attrs["seed"]


@pytest.mark.parametrize(
    ("damage", "expected"),
    [
        (set_muon("kinetic_energy", 17, np.nan), ["muon 17 has a kinetic energy outside 0.01 to 100 GeV"]),
        (set_muon("kinetic_energy", 0, np.inf), ["muon 0 has a kinetic energy outside"]),
        (set_muon("kinetic_energy", 999, 0), ["muon 999 has a kinetic energy outside"]),
        (set_muon("kinetic_energy", 17, 100.1), ["muon 17 has a kinetic energy outside 0.01 to 100 GeV"]),
        (set_muon("u", 17, np.nan), ["muon 17 has a direction whose length is not 1"]),
        (set_muon("v", 17, 1e30), ["muon 17 has a direction whose length is not 1"]),
        (set_muon("pdg_id", 17, 0), ["muon 17 has a charge other than -1 and +1"]),
        (set_muon("pdg_id", 17, 11), ["muon 17 has a charge other than -1 and +1"]),
        (lambda muons: muons["w"].write_direct(-muons["w"][:]), ["muon 0 does not go down"]),
        (
            several,
            ["attribute seed is missing", "muon 3 has a kinetic energy", "muon 5 has a direction", "muon 5 does"],
        ),
        (shorten, ["column u has 999 muons, and the attribute count is 1000", "muons were not examined"]),
        (shorten_all, [f"column {name} has 999 muons" for name in ("kinetic_energy", "u", "v", "w", "pdg_id")]),
        (delete_column, ["column w is missing", "muons were not examined"]),
        (group_for_a_column, ["column w is missing", "muons were not examined"]),
        (link_to_another_file, ["column v is missing", "muons were not examined"]),
        (soft_link_to_another_file, ["column v is missing", "muons were not examined"]),
        (virtual_column, ["column v can't be read: its source ", "muons were not examined"]),
        (absolute_source, ["v can't be read: its source /other.h5 is not named by a path relative", "not examined"]),
        (other_column_as_source, ["v can't be read: its source other.h5 is not the column v", "not examined"]),
        (add_places_and_times(x=one_bad(np.inf, "f4")), ["muon 500 has a place that is not finite"]),
        (add_places_and_times(x=None), ["column x is missing", "muons were not examined"]),
        (add_places_and_times(y=np.zeros(MUONS)), ["column y is float64", "muons were not examined"]),
        (add_places_and_times(z=np.zeros(5, "f4")), ["column z has 5 muons", "muons were not examined"]),
        (add_places_and_times(time=one_bad(np.nan, "f8")), ["muon 500 has a time that is not finite and from 0 on"]),
        (add_places_and_times(time=one_bad(1.0, "f8")), ["muon 501 comes before the muon before it"]),
        (
            add_places_and_times(time=-np.ones(MUONS)),
            ["muon 0 has a time that is not finite and from 0 on", "muon 0 comes before the muon before it"],
        ),
        (replace_column("u", data=np.zeros(MUONS)), ["column u is float64 of shape", "muons were not examined"]),
        (replace_column("u", data=np.zeros(MUONS, ">f4")), ["column u is >f4 of shape", "muons were not examined"]),
        (replace_column("u", data=np.zeros((MUONS, 1), "f4")), ["u is float32 of shape (1000, 1)", "not examined"]),
        (replace_column("u", shape=MUONS, dtype="f4"), ["column u holds 0 of its 4000 bytes", "not examined"]),
        (
            replace_column("u", shape=MUONS, dtype="f4", chunks=(100,)),
            ["column u holds 0 of its 10 chunks", "muons were not examined"],
        ),
        (take_units, ["column kinetic_energy has the units None, and should have 'GeV'"]),
        (set_attribute("count", 1001), ["live_time_s_m2", "numbers 0 to 1001"] + 5 * ["has 1000 muons, and the"]),
        (delete_attribute("medium"), ["attribute medium is missing", "that of its model quantile-10m.onnx"]),
        (set_attribute("energy_min_gev", np.nan), ["attribute energy_min_gev is nan, and should be a finite number"]),
        (
            set_attribute("zenith_max_degrees", 91),
            ["attribute zenith_max_degrees is 91, and should be a number of"],
        ),
        (set_attribute("surface", 2), ["attribute surface is 2, and should be 0 (a horizontal plane) or 1 (a sphere)"]),
        (set_attribute("target_size_m", [1.0]), ["target_size_m goes with target, which is not there"]),
        (set_attribute("live_time_s_m2", 20.0), ["attribute live_time_s_m2 is 20.0, and count / rate_hz_per_m2"]),
        (set_attribute("depth_m", 11.0), ["attribute depth_m is 11.0, and that of its model quantile-10m.onnx is 10"]),
        (set_attribute("shard", "1/2"), ["numbers 0 to 1000 (without the end) of 1000 by first"]),
        (set_attribute("created", "now\nor never\x1b[2J"), ["attribute created is 'now\\nor never\\x1b[2J', and"]),
        (lambda muons: muons.file.__delitem__("muons"), ["there is no group /muons"]),
    ],
)
def test_each_defect_is_named_in_a_line_with_its_first_muon(check, good_file, damage, expected):
    with h5py.File(good_file, "r+") as file:
        damage(file["muons"])
        if "muons" in file:
            sign(file["muons"])
    code, lines, err = check(good_file)
    assert (code, err) == (3, "")
    found = defects(lines)
    assert [part for part in expected if not any(part in line for line in found)] == []
    assert len(found) == len(expected)
    assert lines[-1] == f"{len(found)} defect{'s' * (len(found) > 1)} found"


def test_a_defect_far_inside_is_counted_and_numbered_from_the_beginning(check, tmp_path, model_file):
    path = tmp_path / "muons.h5"
    Generator.open(file=model_file).write(path, 300_000, seed=1)
    with h5py.File(path, "r+") as file:
        file["muons/pdg_id"][200_000:270_000] = 1
        sign(file["muons"])
    code, lines, _ = check(path)
    assert code == 3
    (defect,) = defects(lines)
    assert defect.startswith("muon 200000 has a charge other than -1 and +1 (kinetic energy ")
    assert defect.endswith("; so 70000 muons")


@pytest.mark.parametrize("value", [None, 1.5, "0"])
def test_a_column_without_its_checksum_is_a_defect(check, good_file, value):
    with h5py.File(good_file, "r+") as file:
        del file["muons/u"].attrs["crc32"]
        if value is not None:
            file["muons/u"].attrs["crc32"] = value
    code, lines, _ = check(good_file)
    assert (code, defects(lines)) == (
        3,
        [f"the column u has the checksum {value!r}, and should have a number, its CRC-32"],
    )


def bytes_of_columns(path: Path) -> list[tuple[str, int, int]]:
    """Return the name, position and length of each stretch of a column in a file."""
    with h5py.File(path) as file:
        chunks = [
            (name, column.id.get_chunk_info(number))
            for name, column in file["muons"].items()
            for number in range(column.id.get_num_chunks())
        ]
        sizes = {name: (column.dtype.itemsize, len(column), column.chunks[0]) for name, column in file["muons"].items()}
    return [
        (name, chunk.byte_offset, sizes[name][0] * min(sizes[name][2], sizes[name][1] - chunk.chunk_offset[0]))
        for name, chunk in chunks
    ]


@pytest.mark.campaign
def test_a_flipped_bit_anywhere_in_a_column_is_found_and_its_column_named(endings, good_file, check):
    """The first, the last and 30 other bytes of each column: 160 files."""
    content = good_file.read_bytes()
    random = np.random.default_rng(3)
    positions = [
        start + offset
        for _, start, length in bytes_of_columns(good_file)
        for offset in (0, length - 1, *random.integers(length, size=30))
    ]

    def flipped(position: int, bit: int) -> bytes:
        copy = bytearray(content)
        copy[position] ^= 1 << bit
        return bytes(copy)

    assert endings(flipped(position, random.integers(8)) for position in positions) == {3: len(positions)}
    for name, start, _ in bytes_of_columns(good_file):
        good_file.write_bytes(flipped(start, 0))  # of an energy or a direction: a muon as good as any
        found = defects(check(good_file)[1])
        assert any(line.startswith(f"the column {name} is not what was written: its CRC-32 is ") for line in found)


@pytest.mark.parametrize("how", ["missing", "folder", "pipe", "empty", "text", "other HDF5", "later version"])
def test_what_is_no_muon_file_is_refused_in_one_line(check, tmp_path, how):
    path = tmp_path / "muons.h5"
    if how == "folder":
        path.mkdir()
    elif how == "pipe":
        os.mkfifo(path)
    elif how in ("empty", "text"):
        path.write_text("" if how == "empty" else "no HDF5")
    elif how != "missing":
        with h5py.File(path, "w") as file:
            file["numbers"] = 1
            if how == "later version":
                file.attrs.update({"format": "deepmuon-muons", "format_version": 3})
    code, lines, err = check(path)
    assert (code, lines) == (2, [])
    assert err.startswith("deepmuon-check: ")
    assert err.count("\n") == 1


def test_a_compressed_file_is_good(check, good_file):
    with h5py.File(good_file, "r+") as file:
        for name, column in list(file["muons"].items()):
            numbers, attributes = column[:], dict(column.attrs)
            del file["muons"][name]
            file["muons"].create_dataset(name, data=numbers, compression="gzip").attrs.update(attributes)
    assert check(good_file)[0] == 0


def wait_until_read(path: Path, parent: int) -> None:
    """Wait until the child of a process has opened a file."""
    end = time.monotonic() + LONGEST
    opened: set[str] = set()
    while str(path) not in opened:
        assert time.monotonic() < end
        time.sleep(0.01)
        for child in Path(f"/proc/{parent}/task/{parent}/children").read_text().split():
            for link in Path(f"/proc/{child}/fd").iterdir():
                with contextlib.suppress(FileNotFoundError):  # closed meanwhile
                    opened.add(os.readlink(link))


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=["Ctrl-C", "SIGTERM"])
def test_a_check_can_be_stopped(environment, tmp_path, number, code):
    """The file is a large one full of one muon, which compression makes small."""
    path = tmp_path / "muons.h5"
    n, chunk = 1_000_000_000, 1 << 20  # minutes of reading, a fraction of a second for a chunk
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": "deepmuon-muons", "format_version": 1})
        group = file.create_group("muons")
        for name, value in {"kinetic_energy": 1, "u": 0, "v": 0, "w": -1, "pdg_id": 13}.items():
            dtype = "i1" if name == "pdg_id" else "f4"
            column = group.create_dataset(name, (n,), dtype, chunks=(chunk,), compression="gzip")
            column[:chunk] = np.full(chunk, value, dtype)
            content = column.id.read_direct_chunk((0,))[1]
            for first in range(chunk, n, chunk):
                column.id.write_direct_chunk((first,), content)
    process = subprocess.Popen([COMMAND, path], env=environment, stderr=subprocess.PIPE, text=True)
    wait_until_read(path, process.pid)
    process.send_signal(number)
    _, err = process.communicate(timeout=LONGEST)
    assert (process.returncode, err) == (code, f"deepmuon-check: stopped by {number.name}\n")


def codes(paths: Iterable[Path], environment: dict[str, str]) -> Counter[int]:
    """Count the exit codes of checks, each in a process of its own."""
    done = subprocess.run(
        [sys.executable, MANY, "check"],
        input="".join(f"{json.dumps([str(path)])}\n" for path in paths),
        env={**environment, "OPENBLAS_NUM_THREADS": "1"},  # no thread may run when a process forks
        capture_output=True,
        text=True,
        check=True,
    )
    return Counter(map(int, done.stdout.split()))


@pytest.fixture
def endings(environment, tmp_path):
    """Check contents as files, and count the exit codes."""

    def run(contents: Iterable[bytes]) -> Counter[int]:
        paths = []
        for number, content in enumerate(contents):
            paths.append(tmp_path / f"damaged-{number}.h5")
            paths[-1].write_bytes(content)
        return codes(paths, environment)

    return run


@pytest.mark.campaign
def test_no_truncated_file_passes_or_ends_the_check(endings, good_file):
    """200 lengths."""
    content = good_file.read_bytes()
    lengths = np.random.default_rng(1).integers(len(content), size=200 * TIMES)
    assert endings(content[:length] for length in lengths) == {2: len(lengths)}


def bytes_of_no_column(path: Path) -> np.ndarray:
    """Return the positions of the bytes that say where the columns are and what they mean."""
    is_free = np.ones(path.stat().st_size, bool)
    with h5py.File(path) as file:
        for column in file["muons"].values():
            for number in range(column.id.get_num_chunks()):
                chunk = column.id.get_chunk_info(number)
                is_free[chunk.byte_offset : chunk.byte_offset + chunk.size] = False
    return np.flatnonzero(is_free)


@pytest.mark.campaign
@pytest.mark.parametrize("where", ["anywhere", "in what describes the columns"])
def test_random_bytes_never_end_the_check_by_a_signal_or_without_end(endings, good_file, where):
    """250 files in each place, 1 to 8 bytes each. Without the process of its own a few of them end it by SIGSEGV."""
    random = np.random.default_rng(2)
    content = np.frombuffer(good_file.read_bytes(), np.uint8)
    positions = np.arange(len(content)) if where == "anywhere" else bytes_of_no_column(good_file)

    def damaged() -> bytes:
        copy = content.copy()
        hit = random.choice(positions, random.integers(1, 9))
        copy[hit] = random.integers(256, size=len(hit))
        return copy.tobytes()

    found = endings(damaged() for _ in range(250 * TIMES))
    assert found.keys() <= {0, 2, 3}
    assert found[2] > 0
    assert found[3] > 50


@pytest.mark.parametrize("command", ["check", "convert", "merge", "plot"])
def test_a_file_that_another_program_writes_is_refused_with_the_way_on(tmp_path, model_file, command):
    Generator.open(file=model_file).write(tmp_path / "muons.h5", 10, seed=1)
    output = {"check": [], "convert": ["a.csv"], "merge": ["-o", "a.h5"], "plot": ["-o", "a.png"]}[command]
    asked = [Path(sysconfig.get_path("scripts")) / f"deepmuon-{command}", "muons.h5", *output]
    with h5py.File(tmp_path / "muons.h5", "r+"):
        done = subprocess.run(asked, cwd=tmp_path, capture_output=True, text=True, timeout=120)
        forced = subprocess.run(
            asked, cwd=tmp_path, timeout=120, env={**os.environ, "HDF5_USE_FILE_LOCKING": "FALSE"}, check=False
        )
    assert done.returncode == 2
    assert done.stderr.endswith(
        "another program has it open for writing; close it there, or set HDF5_USE_FILE_LOCKING=FALSE if that program "
        "writes no more\n"
    )
    assert done.stderr.count("\n") == 1
    assert forced.returncode == 0
