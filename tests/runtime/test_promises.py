"""What is promised of the muons of a seed, for whole files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, Muons, Shard, merge_shards
from deepmuon_runtime.sampling import selection

N, SEED = 400_001, 2**64 - 1
NOT_PROMISED = ("created", "attributes_crc32")


@pytest.fixture(scope="module", params=[1, 300], ids=lambda d: f"{d} muons a draw")
def model(request, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("model") / "tiny.onnx"
    path.write_bytes(tiny_model(request.param))
    return path


def contents(path: Path) -> dict[str, Any]:
    """Return all that is in a file: the bytes of every dataset, and every attribute but two."""
    found: dict[str, Any] = {}

    def note(name: str, node: h5py.HLObject) -> None:
        if isinstance(node, h5py.Dataset):
            found[name] = node.dtype.str, node[:].tobytes()
        for key, value in node.attrs.items():
            if key not in NOT_PROMISED:
                found[f"{name}@{key}"] = np.asarray(value).dtype.str, np.asarray(value).tolist()

    with h5py.File(path) as file:
        note("", file)
        file.visititems(note)
    return found


@pytest.fixture(scope="module")
def single(model, tmp_path_factory) -> dict[str, Any]:
    path = tmp_path_factory.mktemp("single") / "muons.h5"
    Generator.open(file=model, threads=1).write(path, N, SEED)
    found = contents(path)
    assert len(found["muons/kinetic_energy"][1]) == 4 * N
    return found


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("piece", [1, 50_000, 1 << 17])
def test_a_file_is_the_same_for_any_threads_and_pieces(model, single, tmp_path, monkeypatch, threads, piece):
    monkeypatch.setitem(selection.PIECE, "cpu", piece)
    Generator.open(file=model, threads=threads).write(tmp_path / "muons.h5", N, SEED)
    assert contents(tmp_path / "muons.h5") == single


@settings(deadline=None, max_examples=6)
@given(of=st.integers(1, 9), data=st.data())
def test_a_file_is_the_same_for_any_split(model, single, tmp_path_factory, of, data):
    folder = tmp_path_factory.mktemp("split")
    paths = [folder / f"{number}.h5" for number in range(1, of + 1)]
    for number, path in enumerate(paths, start=1):
        threads = data.draw(st.integers(1, 3))
        Generator.open(file=model, threads=threads).write(path, N, SEED, shard=Shard(number, of))
    for virtual in (False, True):
        merge_shards(data.draw(st.permutations(paths)), folder / f"{virtual}.h5", virtual=virtual)
        assert contents(folder / f"{virtual}.h5") == single


@settings(deadline=None, max_examples=6)
@given(n=st.integers(1, N))
def test_a_shorter_file_is_the_beginning_of_a_longer_one(model, single, tmp_path_factory, n):
    path = tmp_path_factory.mktemp("short") / "muons.h5"
    Generator.open(file=model).write(path, n, SEED)
    short = contents(path)
    for name, (dtype, content) in short.items():
        if "@" not in name:
            assert (dtype, content) == (single[name][0], single[name][1][: len(content)])
    differing = {name.partition("@")[2] for name in short if "@" in name and short[name] != single[name]}
    assert differing <= {"count", "total", "live_time_s_m2", "crc32"}


def rows(muons: Muons) -> np.ndarray:
    """Return each muon as one value of 16 bytes."""
    columns = np.stack([muons.kinetic_energy, muons.u, muons.v, muons.w], axis=1)
    return columns.view("V16").ravel()


def test_seeds_and_shards_share_no_muon(model):
    """By chance two of them would once in a thousand million times."""
    generator = Generator.open(file=model)
    samples = [generator.sample(100_000, seed) for seed in (0, 1, 2, 2**32, 2**63, SEED)]
    samples += [generator.sample(100_000, seed=0, first=first) for first in (100_000, 10**6, 10**12, 2**53 - 100_000)]
    together = np.concatenate([rows(muons) for muons in samples])
    assert len(np.unique(together)) == len(together) == 1_000_000


def test_the_shards_of_a_family_at_a_depth_are_its_single_run(tmp_path, family_file):
    generator = Generator.open(13.7, file=family_file)
    generator.write(tmp_path / "single.h5", 5000, seed=SEED)
    parts = [tmp_path / f"{number}.h5" for number in (1, 2, 3)]
    for number, part in enumerate(parts, start=1):
        Generator.open(13.7, file=family_file).write(part, 5000, seed=SEED, shard=Shard(number, 3))
    merge_shards(parts, tmp_path / "merged.h5")
    assert contents(tmp_path / "merged.h5") == contents(tmp_path / "single.h5")
