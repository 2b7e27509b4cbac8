from __future__ import annotations

import numpy as np
import onnxruntime
import pytest
from numpy.typing import NDArray
from support.tiny_models import tiny_model

from deepmuon_runtime.latents.philox import latents
from deepmuon_runtime.model.bound_run import BoundRun
from deepmuon_runtime.model.contract import INPUT, OUTPUTS
from deepmuon_runtime.model.device import open_session

DRAWS = 100

on_cpu = onnxruntime.OrtValue.ortvalue_from_numpy


@pytest.fixture(scope="module")
def session() -> onnxruntime.InferenceSession:
    return open_session(tiny_model(), "tiny", "cpu")[0]


@pytest.fixture
def memory_of_its_own(monkeypatch):
    """Stands for a GPU's memory: a copy that the caller's array does not share."""

    def elsewhere(array: NDArray[np.generic], device: str) -> onnxruntime.OrtValue:
        assert device == "cuda"
        return on_cpu(array.copy(), "cpu")

    monkeypatch.setattr(onnxruntime.OrtValue, "ortvalue_from_numpy", staticmethod(elsewhere))


def check_runs(run: BoundRun, session: onnxruntime.InferenceSession) -> None:
    for seed in (1, 2):
        run.latent[:] = latents(seed, 0, DRAWS, 4)
        found = run()
        expected = session.run(OUTPUTS, {INPUT: run.latent})
        for array, same in zip(found, expected, strict=True):
            assert array.dtype == same.dtype
            assert np.array_equal(array, same)


def test_each_run_starts_from_what_the_latents_are_then(session):
    check_runs(BoundRun(session, "cpu", DRAWS, 4, DRAWS), session)


@pytest.mark.usefixtures("memory_of_its_own")
def test_latents_are_copied_to_a_device_and_muons_back(session):
    check_runs(BoundRun(session, "cuda", DRAWS, 4, DRAWS), session)


def test_on_the_cpu_the_muons_of_the_next_run_lie_where_the_last_ones_did(session):
    run = BoundRun(session, "cpu", DRAWS, 4, DRAWS)
    assert all(np.shares_memory(a, b) for a, b in zip(run(), run(), strict=True))


@pytest.mark.parametrize("muons", [DRAWS - 1, DRAWS + 1, 2 * DRAWS])
def test_a_model_that_makes_another_number_of_muons_writes_none_beyond_its_memory(session, muons):
    with pytest.raises(RuntimeError, match="shape"):
        BoundRun(session, "cpu", DRAWS, 4, muons)()
