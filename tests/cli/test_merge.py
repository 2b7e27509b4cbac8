from __future__ import annotations

import os
import subprocess
import sysconfig
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.muon_files import sign, sign_attributes
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, RefusedError, Shard, read_attributes, read_muons

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-merge"
CHECK = Path(sysconfig.get_path("scripts")) / "deepmuon-check"
MUONS = 300_001


@pytest.fixture
def merge(tmp_path):
    """Run the installed command on files of a folder: exit code, stdout, stderr."""

    def run(*arguments: str) -> tuple[int, str, str]:
        done = subprocess.run([COMMAND, *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=600)
        return done.returncode, done.stdout, done.stderr

    return run


@pytest.fixture
def generator(model_file) -> Generator:
    return Generator.open(file=model_file)


def write_shards(generator: Generator, folder: Path, *shards: str, n: int = MUONS, seed: int = 2**64 - 1) -> list[str]:
    names = [f"part-{shard.replace('/', '-of-')}-{seed}-{n}.h5" for shard in shards]
    for name, shard in zip(names, shards, strict=True):
        generator.write(folder / name, n, seed, shard=Shard.parse(shard))
    return names


@pytest.mark.parametrize("shards", [["1/1"], ["3/3", "1/3", "2/3"], ["1/2", "3/4", "4/4"]], ids=" ".join)
@pytest.mark.parametrize("n", [2, MUONS])
def test_shards_joined_are_the_file_of_the_single_run(merge, generator, tmp_path, shards, n):
    names = write_shards(generator, tmp_path, *shards, n=n)
    generator.write(tmp_path / "single.h5", n, seed=2**64 - 1)
    assert merge(*names, "-o", "all.h5") == (
        0,
        f"all.h5: {n:,} muons of {len(names)} shard{'s' if len(names) > 1 else ''}\n",
        "",
    )
    with h5py.File(tmp_path / "all.h5") as merged, h5py.File(tmp_path / "single.h5") as single:
        assert merged["muons"].attrs["seed"].dtype == np.uint64
        for name, column in single["muons"].items():
            assert np.array_equal(merged["muons"][name][:], column[:])
    found, expected = read_attributes(tmp_path / "all.h5"), read_attributes(tmp_path / "single.h5")
    del found["created"], expected["created"]
    assert found == expected


@pytest.mark.parametrize(
    ("shards", "reason"),
    [
        (["1/3", "2/3"], "muons 200000 to 300000 of 300001 are missing: no shard after part-2-of-3"),
        (["2/3", "3/3"], "muons 0 to 99999 of 300001 are missing: no shard before part-2-of-3"),
        (["1/3", "3/3"], "muons 100000 to 199999 of 300001 are missing: no shard before part-3-of-3"),
        (["1/2", "2/3", "3/3"], "muons 100000 to 149999 are in part-2-of-3"),
        (["1/1", "2/3"], "muons 100000 to 199999 are in part-2-of-3"),
    ],
)
def test_gaps_and_overlaps_are_refused(merge, generator, tmp_path, shards, reason):
    code, out, err = merge(*write_shards(generator, tmp_path, *shards), "-o", "all.h5")
    assert (code, out) == (2, "")
    assert err.startswith("deepmuon-merge: ")
    assert err.count("\n") == 1
    assert reason in err
    assert not (tmp_path / "all.h5").exists()


def test_shards_of_different_runs_are_refused(merge, generator, tmp_path):
    other = tmp_path / "other.onnx"
    other.write_bytes(tiny_model(metadata={"created_by": "somebody else"}))
    (first,) = write_shards(generator, tmp_path, "1/2", n=100)
    others = {
        "seed": write_shards(generator, tmp_path, "2/2", n=100, seed=6),
        "total": write_shards(generator, tmp_path, "2/2", n=101),
        "model_sha256": write_shards(Generator.open(file=other), tmp_path, "2/2", n=100),
    }
    for name, (second,) in others.items():
        code, _, err = merge(first, second, "-o", "all.h5")
        assert code == 2
        assert "are of different runs: their " + name in err
    assert not (tmp_path / "all.h5").exists()


def test_what_is_no_shard_is_refused(merge, generator, tmp_path):
    names = write_shards(generator, tmp_path, "1/2", "2/2", n=100)
    with h5py.File(tmp_path / names[0], "r+") as file:
        del file["muons"].attrs["first"]
        sign_attributes(file["muons"])
    (tmp_path / "text.h5").write_text("no HDF5")
    assert "lacks the attribute first" in merge(*names, "-o", "all.h5")[2]
    assert merge("text.h5", "-o", "all.h5")[0] == 2
    assert merge("missing.h5", "-o", "all.h5")[0] == 2
    assert merge("-o", "all.h5")[0] == 2
    assert not (tmp_path / "all.h5").exists()


def test_an_existing_output_is_replaced_only_where_asked(merge, generator, tmp_path):
    names = write_shards(generator, tmp_path, "1/1", n=100)
    (tmp_path / "all.h5").write_text("precious")
    assert merge(*names, "-o", "all.h5")[0] == 2
    assert (tmp_path / "all.h5").read_text() == "precious"
    assert merge(*names, "-o", "all.h5", "--overwrite", "-q") == (0, "", "")
    assert read_attributes(tmp_path / "all.h5")["count"] == 100


def name_of(path: Path) -> str:
    return path.name


def symbolic_link(path: Path) -> str:
    (path.parent / "links").mkdir()
    (path.parent / "links" / "link.h5").symlink_to(path)
    return "links/link.h5"


def hard_link(path: Path) -> str:
    os.link(path, path.parent / "link.h5")
    return "link.h5"


@pytest.mark.parametrize("options", [[], ["--virtual"]], ids=["copied", "virtual"])
@pytest.mark.parametrize("output", [name_of, symbolic_link, hard_link])
def test_a_shard_is_never_replaced_by_the_whole(merge, generator, tmp_path, options, output):
    names = write_shards(generator, tmp_path, "1/2", "2/2", n=100)
    before = (tmp_path / names[0]).read_bytes()
    code, out, err = merge(*options, *names, "-o", output(tmp_path / names[0]), "--overwrite")
    assert (code, out) == (2, "")
    assert err.endswith("is read here, and would be replaced: give the output another name\n")
    assert (tmp_path / names[0]).read_bytes() == before


def test_shards_of_two_releases_are_joined_and_those_of_two_devices_are_not(merge, generator, tmp_path):
    names = write_shards(generator, tmp_path, "1/2", "2/2", n=100)
    for name, attribute, value in ((names[0], "created_by", "deepmuon-runtime 0.0.1"), (names[1], "device", "cuda")):
        assert merge(*names, "-o", "all.h5", "--overwrite")[0] == 0
        with h5py.File(tmp_path / name, "r+") as file:
            file["muons"].attrs[attribute] = value
            sign_attributes(file["muons"])
    code, _, err = merge(*names, "-o", "all.h5", "--overwrite")
    assert (code, "are of different runs: their device is 'cpu' and 'cuda'" in err) == (2, True)
    with h5py.File(tmp_path / names[1], "r+") as file:
        file["muons"].attrs["device"] = "cpu"
        sign_attributes(file["muons"])
    assert merge(*names, "-o", "all.h5", "--overwrite")[0] == 0
    assert read_attributes(tmp_path / "all.h5")["created_by"] == "deepmuon-runtime 0.0.1"
    assert check(tmp_path / "all.h5")[0] == 0


def make_virtual(merge, generator: Generator, folder: Path, n: int = 1000) -> list[str]:
    """Write three shards in a folder of their own, and a virtual file beside it."""
    (folder / "shards 100%d").mkdir()
    names = [
        f"shards 100%d/{name}" for name in write_shards(generator, folder / "shards 100%d", "1/3", "2/3", "3/3", n=n)
    ]
    assert merge("--virtual", *names, "-o", "all.h5")[0] == 0
    return names


def check(path: Path) -> tuple[int, str]:
    done = subprocess.run([CHECK, path.name], cwd=path.parent, capture_output=True, text=True, timeout=600)
    return done.returncode, done.stdout


@pytest.mark.parametrize("n", [2, MUONS])
def test_a_virtual_file_is_that_of_the_single_run_for_everybody_who_reads_it(merge, generator, tmp_path, n):
    make_virtual(merge, generator, tmp_path, n)
    generator.write(tmp_path / "single.h5", n, seed=2**64 - 1)
    assert (tmp_path / "all.h5").stat().st_size < 50_000
    found = read_muons(tmp_path / "all.h5")
    with h5py.File(tmp_path / "all.h5") as virtual, h5py.File(tmp_path / "single.h5") as single:
        for name, column in single["muons"].items():
            assert np.array_equal(virtual["muons"][name][:], column[:])
            assert np.array_equal(getattr(found, name), column[:])
            assert virtual["muons"][name].attrs["crc32"] == column.attrs["crc32"]
            assert virtual["muons"][name].attrs["units"] == column.attrs["units"]
    assert np.array_equal(read_muons(tmp_path / "all.h5", n // 4, n // 2).u, found.u[n // 4 : n // 4 + n // 2])
    code, out = check(tmp_path / "all.h5")
    assert (code, f"{n:,} muons examined" in out) == (0, True)
    found, expected = read_attributes(tmp_path / "all.h5"), read_attributes(tmp_path / "single.h5")
    del found["created"], expected["created"]
    assert found == expected


def test_a_virtual_file_and_its_shards_may_be_moved_together(merge, generator, tmp_path):
    (tmp_path / "there").mkdir()
    make_virtual(merge, generator, tmp_path)
    for name in ("all.h5", "shards 100%d"):
        (tmp_path / name).rename(tmp_path / "there" / name)
    assert len(read_muons(tmp_path / "there" / "all.h5")) == 1000
    assert check(tmp_path / "there" / "all.h5")[0] == 0


def test_a_virtual_file_is_read_through_a_link_in_another_folder(merge, generator, tmp_path):
    make_virtual(merge, generator, tmp_path)
    (tmp_path / "elsewhere").mkdir()
    link = tmp_path / "elsewhere" / "link.h5"
    link.symlink_to(tmp_path / "all.h5")
    assert len(read_muons(link)) == 1000
    assert check(link)[0] == 0


def test_a_missing_shard_is_named_and_nobody_gets_its_muons(merge, generator, tmp_path, monkeypatch):
    names = make_virtual(merge, generator, tmp_path)
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "shards 100%d").mkdir(parents=True)
    (tmp_path / names[1]).rename(elsewhere / names[1])
    monkeypatch.chdir(elsewhere)  # where HDF5 finds it by itself
    code, out = check(tmp_path / "all.h5")
    assert code == 3
    assert f"defect: the column u can't be read: its source {tmp_path.resolve() / names[1]} is missing" in out
    with pytest.raises(RefusedError, match=r"its source .*part-2-of-3.* is missing"):
        read_muons(tmp_path / "all.h5")
    assert len(read_muons(tmp_path / "all.h5", 0, 333)) == 333  # of the first shard


def change_muon(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file["muons/kinetic_energy"][7] = 1.5


def shorten(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        for column in file["muons"].values():
            column.resize((300,))


def make_doubles(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        numbers = file["muons/u"][:].astype(float)
        del file["muons/u"]
        file["muons/u"] = numbers


def refer_on(path: Path) -> None:
    path.rename(path.with_suffix(".moved"))
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": "deepmuon-muons", "format_version": 2})
        for name, dtype in (("kinetic_energy", "f4"), ("u", "f4"), ("v", "f4"), ("w", "f4"), ("pdg_id", "i1")):
            layout = h5py.VirtualLayout((333,), dtype)
            layout[:] = h5py.VirtualSource(str(path.with_suffix(".moved")).replace("%", "%%"), f"muons/{name}", (333,))
            file.create_virtual_dataset(f"muons/{name}", layout)


def make_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (change_muon, "the column kinetic_energy (or one of its sources) is not what was written: its CRC-32 is"),
        (shorten, "there is no column of 333 muons"),
        (make_doubles, "is float64 of shape (333,), and should be float32 of one dimension"),
        (refer_on, "the column keeps its numbers in other files"),
        (make_pipe, "is missing"),
        (lambda path: path.write_text("no HDF5"), "can't be read"),
        (lambda path: path.write_bytes(path.read_bytes()[:5000]), "can't be read"),
    ],
)
def test_a_changed_shard_is_found_by_the_check(merge, generator, tmp_path, change, reason):
    names = make_virtual(merge, generator, tmp_path)
    change(tmp_path / names[0])
    code, out = check(tmp_path / "all.h5")
    assert code == 3
    assert reason in out


def test_a_shard_of_another_seed_in_the_place_of_the_right_one_is_found(merge, generator, tmp_path):
    names = make_virtual(merge, generator, tmp_path)
    (other,) = write_shards(generator, tmp_path, "1/3", n=1000, seed=6)
    (tmp_path / other).rename(tmp_path / names[0])
    assert check(tmp_path / names[0])[0] == 0
    code, out = check(tmp_path / "all.h5")
    assert (code, out.count("(or one of its sources) is not what was written")) == (3, 5)


def test_a_virtual_file_can_be_copied_but_not_be_referred_to(merge, generator, tmp_path):
    make_virtual(merge, generator, tmp_path)
    assert merge("all.h5", "-o", "copy.h5")[0] == 0
    assert check(tmp_path / "copy.h5")[0] == 0
    code, _, err = merge("--virtual", "all.h5", "-o", "virtual.h5")
    assert (code, "keeps its muons in other files" in err) == (2, True)
    assert not (tmp_path / "virtual.h5").exists()


@pytest.mark.parametrize("options", [[], ["--virtual"]], ids=["copied", "virtual"])
def test_shards_that_may_be_empty_are_joined(merge, generator, tmp_path, options):
    names = write_shards(generator, tmp_path, "1/4", "2/4", "3/4", "4/4", n=2)
    assert merge(*options, *names, "-o", "all.h5")[0] == 0
    assert len(read_muons(tmp_path / "all.h5")) == 2
    assert check(tmp_path / "all.h5")[0] == 0


@pytest.mark.parametrize("options", [[], ["--virtual"]], ids=["copied", "virtual"])
def test_a_damaged_shard_is_not_merged(merge, generator, tmp_path, options):
    names = write_shards(generator, tmp_path, "1/2", "2/2", n=1000)
    change_muon(tmp_path / names[1])
    code, out, err = merge(*options, *names, "-o", "all.h5")
    assert (code, out) == (2, "")
    assert f"{names[1]} is damaged: the column kinetic_energy is not what was written" in err
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*names, "tiny.onnx"])


def add_places_and_times(path: Path, start: float) -> dict[str, np.ndarray]:
    with h5py.File(path, "r+") as file:
        n = len(file["muons/u"])
        columns = {name: np.full(n, start, np.float32) for name in "xyz"} | {"time": start + np.arange(n, dtype=float)}
        for name, values in columns.items():
            file["muons"].create_dataset(name, data=values).attrs["units"] = "s" if name == "time" else "m"
        sign(file["muons"])
    return columns


@pytest.mark.parametrize("options", [[], ["--virtual"]], ids=["copied", "virtual"])
def test_places_and_times_are_taken_along(merge, generator, tmp_path, options):
    names = write_shards(generator, tmp_path, "1/2", "2/2", n=1000)
    parts = [add_places_and_times(tmp_path / name, start) for name, start in zip(names, (0, 1000), strict=True)]
    assert merge(*options, *names, "-o", "all.h5")[0] == 0
    assert check(tmp_path / "all.h5")[0] == 0
    with h5py.File(tmp_path / "all.h5") as file:
        for name in ("x", "y", "z", "time"):
            assert np.array_equal(file["muons"][name][:], np.concatenate([part[name] for part in parts]))


@pytest.mark.parametrize("options", [[], ["--virtual"]], ids=["copied", "virtual"])
def test_shards_with_times_and_without_are_not_joined(merge, generator, tmp_path, options):
    names = write_shards(generator, tmp_path, "1/2", "2/2", n=1000)
    add_places_and_times(tmp_path / names[1], 0)
    code, _, err = merge(*options, *names, "-o", "all.h5")
    assert code == 2
    assert "their columns are kinetic_energy, u, v, w, pdg_id and kinetic_energy, u, v, w, pdg_id, x, y, z, time" in err
    assert not (tmp_path / "all.h5").exists()
