"""Muon files of strangers and damaged ones, through the installed commands: refused in one line, nothing is written."""

from __future__ import annotations

import struct
import subprocess
import sysconfig
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from support.commands import endings
from support.muon_files import sign_attributes, write_version_1
from support.thorough import TIMES

from deepmuon_runtime import Generator, Shard, check_file, read_attributes, read_muons

pytestmark = pytest.mark.campaign

SCRIPTS = Path(sysconfig.get_path("scripts"))
SEED = 5

ARGUMENTS = {
    "check": ["muons.h5"],
    "convert": ["muons.h5", "out.csv"],
    "convert to stdout": ["muons.h5", "-"],
    "merge": ["other.h5", "muons.h5", "-o", "out.h5"],
    "virtual merge": ["--virtual", "other.h5", "muons.h5", "-o", "out.h5"],
    "plot": ["muons.h5", "-o", "out.png"],
}


@pytest.fixture
def folder(tmp_path, model_file) -> Path:
    """Both shards of a run."""
    generator = Generator.open(file=model_file, device="cpu")
    for name, shard in (("other.h5", Shard(1, 2)), ("muons.h5", Shard(2, 2))):
        generator.write(tmp_path / name, 2000, 1, shard=shard)
    return tmp_path


def run(folder: Path, command: str) -> tuple[int, str, str]:
    words = [SCRIPTS / f"deepmuon-{command.split()[0] if command != 'virtual merge' else 'merge'}", *ARGUMENTS[command]]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=600)
    return done.returncode, done.stdout, done.stderr


def take_a_secret(muons: h5py.Group) -> None:
    folder, attributes = Path(muons.file.filename).parent, dict(muons["kinetic_energy"].attrs)
    (folder / "secret").write_bytes(b"password" * 500)
    del muons["kinetic_energy"]
    column = muons.create_dataset("kinetic_energy", (1000,), "f4", external=[(f"{folder}/secret", 0, 4000)])
    column.attrs.update(attributes)


def change_a_muon(muons: h5py.Group) -> None:
    muons["kinetic_energy"][7] *= 1.001


def change_the_seed(muons: h5py.Group) -> None:
    muons.attrs["seed"] = np.uint64(2)


def say_a_text_for_the_depth(muons: h5py.Group) -> None:
    muons.attrs["depth_m"] = "ten"
    sign_attributes(muons)


def name_an_attribute_in_no_utf8(muons: h5py.Group) -> None:
    space = h5py.h5s.create(h5py.h5s.SCALAR)
    h5py.h5a.create(muons.id, b"\xff\xfe", h5py.h5t.NATIVE_INT32, space)


CHANGES: dict[Callable[[h5py.Group], None], str] = {
    take_a_secret: "the column kinetic_energy keeps its numbers in a file that is not HDF5",
    change_a_muon: "the column kinetic_energy is not what was written: its CRC-32 is",
    change_the_seed: "what the attributes say is not what was written: its CRC-32 is",
    say_a_text_for_the_depth: "the attribute depth_m is 'ten', and should be a finite number from 0 on",
    name_an_attribute_in_no_utf8: "an attribute has the name b'\\xff\\xfe', which is no UTF-8",
}


@pytest.mark.parametrize("command", ARGUMENTS)
@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
def test_each_command_refuses_the_file_in_one_line_and_writes_nothing(folder, command, change):
    if command == "plot":
        pytest.importorskip("matplotlib")
    with h5py.File(folder / "muons.h5", "r+") as file:
        change(file["muons"])
    before = set(folder.iterdir())
    code, out, err = run(folder, command)
    if command == "check":
        assert (code, err) == (3, "")
        assert "defect: " in out
        assert CHANGES[change] in out
    else:
        assert (code, out) == (2, "")
        assert err.startswith("deepmuon-")
        assert err.count("\n") == 1
        assert CHANGES[change] in err
    assert set(folder.iterdir()) == before


@pytest.mark.parametrize("command", ["convert", "convert to stdout", "check", "merge", "virtual merge", "plot"])
def test_each_command_takes_files_of_version_1(folder, command):
    for name in ("other.h5", "muons.h5"):
        write_version_1(folder / name, read_muons(folder / name), with_uint64(read_attributes(folder / name)))
    code, _, err = run(folder, command)
    assert (code, err) == (0, "")
    if "merge" in command:
        assert check_file(folder / "out.h5").defects == []


def with_uint64(attributes: dict[str, Any]) -> dict[str, Any]:
    return {name: np.uint64(value) if name == "seed" else value for name, value in attributes.items()}


NAMES = (
    *("count", "depth_m", "medium", "seed", "first", "total", "shard", "created", "rate_hz_per_m2", "live_time_s_m2"),
    *("device", "model_sha256", "energy_min_gev", "target_size_m", "attributes_crc32", "remark", "µ"),
)


def random_value(random: np.random.Generator) -> Any:
    """Return a value of any kind that h5py can store."""
    values = [
        "",
        "ten",
        "\x1b[2J\n",
        b"bytes",
        np.bytes_(b"\xff\xfe"),
        -1,
        0,
        1000,
        2**64 - 1,
        1e300,
        np.nan,
        np.inf,
        -0.0,
        np.float16(1),
        np.longdouble(1),
        1j,
        True,
        [],
        ["a", "b"],
        [1.0, np.nan],
        np.zeros((2, 3)),
        np.zeros((0, 3)),
        np.array((1, 2.0), dtype=[("a", "i4"), ("b", "f8")]),
        h5py.Empty("f4"),
        "x" * 10_000,
        np.zeros(7000),
    ]
    return values[random.integers(len(values))]


def damage_attributes(muons: h5py.Group, random: np.random.Generator) -> None:
    """Change, take away or add one to three attributes of a group or of one of its columns."""
    for _ in range(random.integers(1, 4)):
        node = muons if random.random() < 0.7 else muons[random.choice(["kinetic_energy", "u", "pdg_id"])]
        name = str(random.choice(NAMES if node is muons else ["units", "crc32"]))
        if random.random() < 0.2 and name in node.attrs:
            del node.attrs[name]
        else:
            node.attrs[name] = random_value(random)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("command", ["check", "convert", "merge", "virtual merge", "plot"])
def test_no_attribute_of_any_kind_ends_a_command_by_a_traceback(folder, command, version):
    """40 files; signed, where their values can be, so that it is the values that are looked at."""
    if command == "plot":
        pytest.importorskip("matplotlib")
    random = np.random.default_rng(SEED)
    if version == 1:
        for name in ("other.h5", "muons.h5"):
            write_version_1(folder / name, read_muons(folder / name), with_uint64(read_attributes(folder / name)))
    content, lines = (folder / "muons.h5").read_bytes(), []
    for number in range(40 * TIMES):
        path = folder / f"damaged-{number}.h5"
        path.write_bytes(content)
        with h5py.File(path, "r+") as file:
            damage_attributes(file["muons"], random)
            if version == 2 and random.random() < 0.8:
                sign_if_it_can_be(file["muons"])
        names = {"muons.h5": path, "other.h5": folder / "other.h5"}
        names |= {f"out.{end}": folder / f"out-{number}.{end}" for end in ("csv", "h5", "png")}
        lines.append([str(names.get(word, word)) for word in ARGUMENTS[command]])
    found = Counter(endings("merge" if command == "virtual merge" else command, lines))
    assert found.keys() <= {0, 2, 3}
    assert found[3 if command == "check" else 2] > 10 * TIMES


def sign_if_it_can_be(muons: h5py.Group) -> None:
    try:
        sign_attributes(muons)
    except (AttributeError, ValueError, TypeError, struct.error):
        return
