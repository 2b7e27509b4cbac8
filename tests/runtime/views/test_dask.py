from __future__ import annotations

import os
import pickle
import signal
from pathlib import Path

import numpy as np
import pytest
from support.tiny_models import tiny_model

from deepmuon_runtime import Generator, Muons, RefusedError

pytest.importorskip("dask.array")

import dask
from dask.array import Array

from deepmuon_runtime.views.dask import muon_arrays

COLUMNS = ("kinetic_energy", "u", "v", "w", "pdg_id")
LONGEST = 300  # s, on any machine


def computed(arrays: dict[str, Array], **how: str) -> Muons:
    return Muons(**dask.compute(arrays, **how)[0])


def are_equal(a: Muons, b: Muons) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in COLUMNS)


@pytest.fixture
def single(model_file) -> Muons:
    return Generator.open(file=model_file).sample(50_001, seed=5)


@pytest.mark.parametrize("chunk", [7001, 50_001, 10**6])
@pytest.mark.parametrize("scheduler", ["synchronous", "threads"])
def test_any_chunks_are_the_single_run(model_file, single, chunk, scheduler):
    arrays = muon_arrays(50_001, seed=5, file=model_file, chunk=chunk)
    assert list(arrays) == list(COLUMNS)
    assert all(len(array) == 50_001 for array in arrays.values())
    muons = computed(arrays, scheduler=scheduler)
    assert are_equal(muons, single)
    assert all(getattr(muons, name).dtype == arrays[name].dtype for name in COLUMNS)


def test_no_muons_are_empty_arrays(model_file):
    assert len(computed(muon_arrays(0, file=model_file), scheduler="synchronous")) == 0


def test_without_a_seed_the_muons_are_new_ones_but_stay_what_they_are(model_file):
    a, b = (muon_arrays(100, file=model_file) for _ in range(2))
    first, again, other = (computed(arrays, scheduler="synchronous") for arrays in (a, a, b))
    assert are_equal(first, again)
    assert not are_equal(first, other)


def test_what_travels_to_a_worker_is_small(model_file):
    one = pickle.dumps(muon_arrays(1000, seed=1, file=model_file)["u"])
    assert len(one) < 10_000


def test_a_worker_with_another_model_makes_no_muons(tmp_path):
    model = tmp_path / "model.onnx"
    model.write_bytes(tiny_model())
    arrays = muon_arrays(1000, seed=5, file=model)
    model.write_bytes(tiny_model(metadata={"created_by": "someone else"}))
    with pytest.raises(RefusedError, match=r"on this worker has the SHA-256 .* and should have"):
        computed(arrays, scheduler="synchronous")


@pytest.mark.parametrize("chunk", [0, -1])
def test_chunks_without_muons_are_refused(model_file, chunk):
    with pytest.raises(RefusedError, match="chunks of"):
        muon_arrays(10, file=model_file, chunk=chunk)


def test_a_number_that_is_none_is_refused(model_file):
    with pytest.raises(RefusedError, match="is no number of muons"):
        muon_arrays(-1, file=model_file)


@pytest.mark.filterwarnings("default")  # a killed process leaves sockets behind, of which Dask warns
def test_a_killed_worker_changes_nothing(model_file, single, tmp_path: Path):
    """At least one chunk is done, and lost with the worker that made it."""
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=str(tmp_path)
    )
    with cluster, distributed.Client(cluster) as client:
        columns = client.persist(list(muon_arrays(50_001, seed=5, file=model_file, chunk=5000).values()))
        chunks = distributed.futures_of(columns)
        distributed.wait(chunks, return_when="FIRST_COMPLETED")
        killed = next(worker for workers in client.who_has(chunks).values() for worker in workers)
        os.kill(client.run(os.getpid)[killed], signal.SIGKILL)
        made = client.compute(columns)
        distributed.wait(made, timeout=LONGEST)
        assert are_equal(Muons(*client.gather(made)), single)
        assert killed not in client.scheduler_info()["workers"]


@pytest.mark.usefixtures("released_families")
def test_a_flux_and_a_medium_go_to_the_workers():
    chosen = {"flux": "measured", "medium": "rock"}
    arrays = muon_arrays(5001, seed=5, depth=1000, chunk=1000, **chosen)
    single = Generator.open(1000, **chosen).sample(5001, seed=5)
    assert are_equal(computed(arrays, scheduler="threads"), single)


def test_a_depth_of_a_family_goes_to_the_workers(family_file):
    arrays = muon_arrays(5001, seed=5, file=family_file, depth=13.7, chunk=1000)
    single = Generator.open(13.7, file=family_file).sample(5001, seed=5)
    assert are_equal(computed(arrays, scheduler="threads"), single)
