from __future__ import annotations

import pickle
import subprocess
import sys

import numpy as np
import pytest

from deepmuon_runtime.errors import FailedError
from deepmuon_training.underground.mulder_carrier import MIXED, carry_back
from deepmuon_training.underground.overburden import overburden
from deepmuon_training.underground.workers import Workers

WATER = overburden("water")
ENERGY, COSINE = np.array([1.0, 30.0, 500.0]), np.array([0.3, 0.7, 1.0])


def test_another_process_carries_muons_back_as_this_one_does():
    here = carry_back(WATER, MIXED, 200.0, ENERGY, COSINE, 7)
    with Workers(WATER, 2) as two:
        there = two.carry_back(MIXED, 200.0, ENERGY, COSINE, 7)
    for one, other in zip(here, there, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_muon_had_more_energy_at_the_surface_and_came_as_it_arrives_unless_it_scattered():
    origins = carry_back(WATER, MIXED, 200.0, ENERGY, COSINE, 7)
    assert np.all(origins.weight > 0)
    assert np.all(origins.energy - ENERGY > 0.2 * 200 / COSINE)  # GeV: minimum ionisation takes 0.2 a metre
    np.testing.assert_allclose(origins.cos_zenith, COSINE, atol=1e-3)  # but for the Earth's curvature


def test_a_process_that_was_killed_is_a_failure_and_no_endless_wait():
    with Workers(WATER, 2) as two:
        for worker in [two._idle.get(), two._idle.get()]:
            worker._process.kill()
            two._idle.put(worker)
        with pytest.raises(FailedError, match="a process of mulder ended"):
            two.carry_back(MIXED, 200.0, ENERGY, COSINE, 7)


def test_a_process_ends_in_silence_when_nobody_asks_any_more():
    call = pickle.dumps((WATER, MIXED, 200.0, ENERGY, COSINE, 7), protocol=5)
    program = [sys.executable, "-m", "deepmuon_training.underground.workers"]
    for asked in (call, call[: len(call) // 2]):
        ended = subprocess.run(program, input=asked, capture_output=True, timeout=300)
        assert ended.returncode == 0
        assert ended.stderr == b""
