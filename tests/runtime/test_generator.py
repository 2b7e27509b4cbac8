from __future__ import annotations

import hashlib
import sys
import threading
from contextlib import closing
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.tiny_models import RARELY_BAD, tiny_model

from deepmuon_runtime import (
    FailedError,
    Generator,
    Muons,
    RefusedError,
    Shard,
    check_file,
    read_attributes,
    read_muons,
)
from deepmuon_runtime.latents.philox import latents

COLUMNS = ("kinetic_energy", "u", "v", "w", "pdg_id")


def are_equal(a: Muons, b: Muons) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in COLUMNS)


def opened(folder: Path, content: bytes, threads: int | None = None) -> Generator:
    path = folder / "model.onnx"
    path.write_bytes(content)
    return Generator.open(file=path, threads=threads)


@pytest.fixture(scope="module", params=[1, 8, 300], ids=lambda d: f"{d} muons a draw")
def generator(request, tmp_path_factory) -> Generator:
    return opened(tmp_path_factory.mktemp("model"), tiny_model(request.param))


@pytest.fixture(scope="module")
def many(generator) -> Muons:
    """More muons than two chunks hold."""
    return generator.sample(300_001, seed=5)


def test_a_muon_is_made_of_its_own_latents(generator, many):
    """The graph is simple enough to be done again in numpy."""
    size = 4 * generator.model.muons_per_draw
    draws = -(-len(many) // generator.model.muons_per_draw)
    l0, l1, l2, l3 = latents(5, 0, draws, size, generator.model.stream).reshape(-1, 4)[: len(many)].T.astype(float)
    cosine, azimuth = 0.55 + 0.4 * l1, np.pi * l2
    np.testing.assert_allclose(many.kinetic_energy, np.exp(3 * l0), rtol=1e-5)
    np.testing.assert_allclose(many.cos_zenith, cosine, rtol=1e-5)
    np.testing.assert_allclose(many.u, np.sqrt(1 - cosine**2) * np.cos(azimuth), atol=1e-5)
    np.testing.assert_allclose(many.v, np.sqrt(1 - cosine**2) * np.sin(azimuth), atol=1e-5)
    assert np.array_equal(many.charge, np.where(l3 > 0, 1, -1))


@settings(deadline=None, max_examples=20)
@given(n=st.integers(0, 300_001))
def test_a_shorter_run_is_the_beginning_of_a_longer_one(generator, many, n):
    assert are_equal(generator.sample(n, seed=5), many[:n])


@settings(deadline=None, max_examples=20)
@given(first=st.integers(0, 300_001), data=st.data())
def test_any_part_of_a_run_can_be_made_by_itself(generator, many, first, data):
    n = data.draw(st.integers(0, len(many) - first))
    assert are_equal(generator.sample(n, seed=5, first=first), many[first : first + n])
    assert are_equal(
        Muons.concatenate([Muons.empty(0), *generator.chunks(n, seed=5, first=first)]), many[first : first + n]
    )


@pytest.mark.parametrize("first", [10**10 + 7, 2**53 - 1000])
def test_muons_far_away_are_made_of_their_own_latents(generator, first):
    per_draw = generator.model.muons_per_draw
    draw, skipped = divmod(first, per_draw)
    draws = -(-(skipped + 1000) // per_draw)
    l0 = latents(5, draw, draws, 4 * per_draw, generator.model.stream).reshape(-1, 4)[skipped : skipped + 1000, 0]
    np.testing.assert_allclose(generator.sample(1000, seed=5, first=first).kinetic_energy, np.exp(3 * l0), rtol=1e-5)


@pytest.mark.parametrize("of", [1, 2, 3, 7])
def test_the_shards_joined_are_the_single_run(generator, many, tmp_path, of):
    """Bit by bit, each shard made with another number of threads."""
    count = 0
    for number in range(1, of + 1):
        path = tmp_path / f"{number}.h5"
        other = opened(tmp_path, tiny_model(generator.model.muons_per_draw), threads=1 + number % 3)
        other.write(path, len(many), seed=5, shard=Shard(number, of))
        part, found = read_muons(path), read_attributes(path)
        assert are_equal(part, many[count : count + len(part)])
        assert (found["first"], found["count"], found["total"]) == (count, len(part), len(many))
        assert found["shard"] == f"{number}/{of}"
        assert found["live_time_s_m2"] == len(part) / 55.5
        count += len(part)
    assert count == len(many)


def test_a_shard_is_stored_in_chunks_as_large_as_those_of_the_single_run(model_file, tmp_path):
    generator = Generator.open(file=model_file)
    for shard in (Shard(1, 1), Shard(2, 3)):
        generator.write(tmp_path / "muons.h5", 900_000, seed=5, shard=shard, overwrite=True)
        with h5py.File(tmp_path / "muons.h5") as file:
            assert file["muons/u"].chunks == (1 << 17,)


def test_there_may_be_more_shards_than_muons(generator, many, tmp_path):
    generator.write(tmp_path / "none.h5", 3, seed=5, shard=Shard(1, 7))
    assert len(read_muons(tmp_path / "none.h5")) == 0
    generator.write(tmp_path / "one.h5", 3, seed=5, shard=Shard(7, 7))
    assert are_equal(read_muons(tmp_path / "one.h5"), many[2:3])


@pytest.mark.parametrize("threads", [1, 2, 3, 7])
def test_the_number_of_threads_changes_nothing(generator, many, tmp_path, threads):
    other = opened(tmp_path, tiny_model(generator.model.muons_per_draw), threads)
    assert other.threads == threads
    assert are_equal(other.sample(len(many), seed=5), many)


def test_chunks_one_after_the_other_are_the_sample(generator, many):
    chunks = list(generator.chunks(len(many), seed=5))
    assert len(chunks) > 1
    assert are_equal(Muons.concatenate(chunks), many)


def test_a_file_holds_the_sample(generator, many, tmp_path):
    generator.write(tmp_path / "muons.h5", len(many), seed=5)
    assert are_equal(read_muons(tmp_path / "muons.h5"), many)


def test_other_seeds_give_other_muons(generator):
    a, b = generator.sample(10_000, seed=1), generator.sample(10_000, seed=2)
    assert not np.intersect1d(a.u, b.u).size > 100
    assert not np.array_equal(a.kinetic_energy, b.kinetic_energy)


def test_a_draw_may_be_larger_than_a_block(tmp_path):
    """Blocks are then of one draw, which begins anywhere among the words of the stream."""
    generator = opened(tmp_path, tiny_model(20_001))
    l0 = latents(5, 0, 8, 4 * 20_001, generator.model.stream).reshape(-1, 4)[:, 0].astype(float)
    many = generator.sample(8 * 20_001, seed=5)
    np.testing.assert_allclose(many.kinetic_energy, np.exp(3 * l0), rtol=1e-5)
    assert are_equal(generator.sample(30_000, seed=5, first=50_000), many[50_000:80_000])


@pytest.mark.parametrize(
    "changes",
    [
        {"depth_m": "10.5"},
        {"medium": "rock"},
        {"flux": "measured"},
        {"architecture": "another"},
        {"created_by": "another program 1.0"},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_another_model_gives_other_muons_of_a_seed(tmp_path, changes):
    """The two have the same graph; the correlation is within 4 standard deviations: 6e-5 false alarms for each."""
    n = 100_000
    one, other = (
        np.log(opened(tmp_path, tiny_model(metadata=metadata)).sample(n, seed=1).kinetic_energy)
        for metadata in ({}, changes)
    )
    assert abs(np.corrcoef(one, other)[0, 1]) < 4 / np.sqrt(n)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"created_by": "the tests 1.0"}, {"created_by": "the tests 2.0"}),
        ({"created_by": "tests", "flux": "cry"}, {"created_by": "another", "flux": "cry"}),
        ({"depth_m": "10"}, {"depth_m": "1e1"}),
        ({"rate_hz_per_m2": "1"}, {"rate_hz_per_m2": "2"}),
    ],
)
def test_what_is_no_part_of_a_models_stream_changes_nothing(tmp_path, one, other):
    a, b = (opened(tmp_path, tiny_model(metadata=metadata)).sample(100, seed=1) for metadata in (one, other))
    assert are_equal(a, b)


def test_without_a_seed_no_two_samples_are_equal(generator):
    assert not are_equal(generator.sample(100), generator.sample(100))


def test_a_file_says_what_its_muons_are(model_file, tmp_path):
    generator = Generator.open(file=model_file, device="cpu")
    generator.write(tmp_path / "muons.h5", 1110, seed=2**64 - 1, attributes={"remark": "for a test"})
    found = read_attributes(tmp_path / "muons.h5")
    assert found.pop("created").startswith("20")
    assert found.pop("created_by").startswith("deepmuon-runtime ")
    assert found == {
        "count": 1110,
        "depth_m": 10.0,
        "medium": "G4_WATER",
        "seed": 2**64 - 1,
        "first": 0,
        "total": 1110,
        "shard": "1/1",
        "model_sha256": hashlib.sha256(model_file.read_bytes()).hexdigest(),
        "architecture": "quantile",
        "device": "cpu",
        "rate_hz_per_m2": 55.5,
        "rate_uncertainty_hz_per_m2": 0.1,
        "live_time_s_m2": 20.0,
        "remark": "for a test",
    }


def test_the_command_line_of_a_program_is_not_recorded(model_file, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["analysis.py", "--password", "secret"])
    Generator.open(file=model_file).write(tmp_path / "muons.h5", 10)
    assert b"secret" not in (tmp_path / "muons.h5").read_bytes()
    assert "command_line" not in read_attributes(tmp_path / "muons.h5")
    assert not check_file(tmp_path / "muons.h5").defects


@pytest.mark.parametrize("seed", [1.7, 1.0, "1", np.float64(1)])
def test_a_seed_that_is_no_whole_number_is_refused(model_file, tmp_path, seed):
    generator = Generator.open(file=model_file)
    with pytest.raises(RefusedError, match="is not a whole number"):
        generator.sample(1, seed=seed)
    with pytest.raises(RefusedError, match="is not a whole number"):
        generator.write(tmp_path / "muons.h5", 1, seed)


def test_a_seed_may_be_of_numpy(model_file):
    generator = Generator.open(file=model_file)
    assert are_equal(generator.sample(10, seed=np.uint64(2**64 - 1)), generator.sample(10, seed=2**64 - 1))


def test_a_model_without_a_rate_gives_files_without_live_time(tmp_path):
    content = tiny_model(metadata={"rate_hz_per_m2": None, "rate_uncertainty_hz_per_m2": None})
    generator = opened(tmp_path, content)
    generator.write(tmp_path / "muons.h5", 10)
    assert not {"rate_hz_per_m2", "live_time_s_m2"} & set(read_attributes(tmp_path / "muons.h5"))
    with pytest.raises(RefusedError, match="does not know its rate"):
        generator.number_in_live_time(1.0, 1.0, seed=1)


def test_no_muons_are_muons_too(generator, tmp_path):
    assert len(generator.sample(0)) == 0
    assert list(generator.chunks(0)) == []
    assert list(generator.chunks(0, first=7)) == []
    generator.write(tmp_path / "muons.h5", 0)
    assert len(read_muons(tmp_path / "muons.h5")) == 0


def test_progress_counts_every_muon_once(model_file, tmp_path):
    steps: list[int] = []
    Generator.open(file=model_file).write(tmp_path / "muons.h5", 300_001, progress=steps.append)
    assert sum(steps) == 300_001
    assert len(steps) > 1


@pytest.mark.parametrize("n", [-1, 1.5, 2**53 + 1, float("nan"), float("inf"), "10", None, [10]])
def test_a_number_that_is_none_is_refused(model_file, tmp_path, n):
    generator = Generator.open(file=model_file)
    for refused in (generator.sample, generator.chunks, lambda n: generator.write(tmp_path / "m.h5", n)):
        with pytest.raises(RefusedError, match="is no number of muons"):
            refused(n)
    assert not (tmp_path / "m.h5").exists()


@pytest.mark.parametrize(("n", "first"), [(1, -1), (1, 0.5), (1, 2**53), (2**53, 1), (0, float("nan")), (1, "0")])
def test_muons_beyond_the_numbers_there_are_are_refused(model_file, n, first):
    generator = Generator.open(file=model_file)
    for refused in (generator.sample, generator.chunks):
        with pytest.raises(RefusedError, match=r"is no number of a first muon|end after number 2\^53"):
            refused(n, first=first)


@pytest.mark.parametrize("seed", [-1, 2**64, 1.5, "1", float("nan"), float("inf")])
def test_a_seed_that_is_none_is_refused(model_file, seed):
    with pytest.raises(RefusedError, match="the seed"):
        Generator.open(file=model_file).sample(1, seed)


def test_more_muons_than_the_memory_holds_are_refused(model_file):
    with pytest.raises(RefusedError, match=r"do not fit in the .* of memory: take them in chunks, or write a file"):
        Generator.open(file=model_file).sample(2**53)


def test_more_muons_than_the_disk_holds_are_refused_with_both_sizes(model_file, tmp_path):
    with pytest.raises(RefusedError, match=r"need 17 PB, and .* has [\d.]+ [kMGT]B free"):
        Generator.open(file=model_file).write(tmp_path / "muons.h5", 10**15)
    assert not (tmp_path / "muons.h5").exists()


def test_a_bad_muon_is_a_failure_that_names_it_and_leaves_no_file(tmp_path):
    generator = opened(tmp_path, tiny_model(edits=RARELY_BAD))
    number = int(np.argmax(np.abs(latents(3, 0, 1_000_000, 4, generator.model.stream)[:, 0] - np.float32(0.3)) < 1e-5))
    assert number > 1000
    assert len(generator.sample(number, seed=3)) == number  # a bad one beyond the end does not matter
    for fails in (generator.sample, lambda n, seed: generator.write(tmp_path / "muons.h5", n, seed)):
        with pytest.raises(FailedError, match=f"number {number} has a kinetic energy outside"):
            fails(1_000_000, 3)
    assert [path.name for path in tmp_path.iterdir()] == ["model.onnx"]


def test_an_abandoned_stream_stops_its_threads(model_file):
    before = threading.active_count()
    with closing(Generator.open(file=model_file, threads=4).chunks(2**53, seed=1)) as chunks:
        assert len(next(chunks)) > 0
        assert threading.active_count() > before
    assert threading.active_count() == before


def test_live_time_gives_a_poisson_number_at_the_models_rate(model_file):
    """At 5 standard deviations: 1e-6 false alarms."""
    generator = Generator.open(file=model_file)
    numbers = [generator.number_in_live_time(10.0, 2.0, seed) for seed in range(1000)]
    assert abs(np.mean(numbers) - 1110) < 5 * np.sqrt(1110 / 1000)


@pytest.mark.parametrize(
    ("live_time", "reason"),
    [
        *((live_time, "are expected") for live_time in (0.0, 1e300, float("nan"), float("inf"))),
        (-1.0, "is no live time"),
    ],
)
def test_a_live_time_that_is_none_is_refused(model_file, live_time, reason):
    with pytest.raises(RefusedError, match=reason):
        Generator.open(file=model_file).number_in_live_time(live_time, 1.0, seed=1)


@pytest.mark.parametrize("threads", [0, -1, 1.5, "2"])
def test_no_threads_are_refused(model_file, threads):
    with pytest.raises(RefusedError, match="threads can't make muons"):
        Generator.open(file=model_file, threads=threads)


def test_a_model_is_named_by_depth_or_by_file_and_one_of_a_single_depth_not_by_both(model_file):
    with pytest.raises(RefusedError, match="which model"):
        Generator.open()
    with pytest.raises(RefusedError, match="is no family"):
        Generator.open(10, file=model_file)


@pytest.mark.parametrize(("live_time", "area"), [("10", 1.0), (10.0, "1"), (None, 1.0)])
def test_a_live_time_or_an_area_that_is_no_number_is_refused(model_file, live_time, area):
    with pytest.raises(RefusedError, match=r"is no (live time|area)"):
        Generator.open(file=model_file).number_in_live_time(live_time, area, seed=1)


@pytest.mark.usefixtures("released")
@pytest.mark.parametrize("depth", ["10", [10], 10j])
def test_a_depth_that_is_no_number_is_refused(depth):
    with pytest.raises(RefusedError, match="is no number: give metres, such as depth=10"):
        Generator.open(depth=depth)


@pytest.mark.usefixtures("released")
@pytest.mark.parametrize("number", [np.float32(10), np.int64(10)], ids=repr)
def test_numpys_numbers_are_numbers(number):
    assert len(Generator.open(depth=number).sample(number, seed=np.int64(number))) == 10


@pytest.mark.usefixtures("released")
def test_a_released_model_opens_by_its_depth_and_architecture():
    assert Generator.open(0).model.name == "quantile-0m.onnx"
    assert Generator.open(depth=10).model.architecture == "quantile"
    transformer = Generator.open(depth=10, architecture="transformer")
    assert transformer.model.muons_per_draw == 8
    assert len(transformer.sample(13)) == 13
