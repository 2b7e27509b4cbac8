from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, Shard, read_attributes

COMMAND = Path(sysconfig.get_path("scripts")) / "deepmuon-merge"
MUONS = 300_001


@pytest.fixture
def merge(tmp_path):
    """Run the installed command on files of a folder: exit code, stdout, stderr."""

    def run(*arguments: str) -> tuple[int, str, str]:
        done = subprocess.run([COMMAND, *arguments], cwd=tmp_path, capture_output=True, text=True, timeout=60)
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
    for name in ("created", "command_line"):
        del found[name], expected[name]
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
