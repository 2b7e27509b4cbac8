from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime import FailedError, Muons
from deepmuon_runtime.physical import check_physical


def good_muons(n: int = 20) -> Muons:
    random = np.random.default_rng(1)
    cosine, azimuth = random.uniform(0.01, 1, n), random.uniform(0, 2 * np.pi, n)
    sine = np.sqrt(1 - cosine**2)
    columns = (random.uniform(0.001, 1000, n), sine * np.cos(azimuth), sine * np.sin(azimuth), -cosine)
    return Muons(*(column.astype(np.float32) for column in columns), np.full(n, 13, np.int8))


def check(muons: Muons) -> None:
    check_physical(muons, 0.001, 1000.0, first=100)


def test_good_muons_pass():
    check(good_muons(100_000))


def test_the_ends_of_the_range_of_energy_pass():
    muons = good_muons(2)
    muons.kinetic_energy[:] = 0.001, 1000.0
    check(muons)


@given(
    index=st.integers(0, 19),
    fault=st.sampled_from(
        [
            ("kinetic_energy", np.nan, "kinetic energy outside"),
            ("kinetic_energy", np.inf, "kinetic energy outside"),
            ("kinetic_energy", -1.0, "kinetic energy outside"),
            ("kinetic_energy", 0.0, "kinetic energy outside"),
            ("kinetic_energy", 0.0009, "kinetic energy outside"),
            ("kinetic_energy", 1001.0, "kinetic energy outside"),
            ("u", np.nan, "length is not 1"),
            ("v", np.inf, "length is not 1"),
            ("w", -1.1, "length is not 1"),
            ("pdg_id", 0, "charge other than"),
            ("pdg_id", 11, "charge other than"),
            ("pdg_id", -128, "charge other than"),
        ]
    ),
)
def test_a_bad_muon_is_named(index, fault):
    column, value, reason = fault
    muons = good_muons()
    getattr(muons, column)[index] = value
    with pytest.raises(FailedError, match=f"number {100 + index} has a .*{reason}"):
        check(muons)


@pytest.mark.parametrize("w", [0.0, 1.0])
def test_a_muon_that_does_not_go_down_is_named(w):
    muons = good_muons()
    muons.u[7], muons.v[7], muons.w[7] = 1 - w, 0, w
    with pytest.raises(FailedError, match="number 107 does not go down"):
        check(muons)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_length_off_by_two_in_a_million_is_seen(sign):
    muons = good_muons()
    for column in (muons.u, muons.v, muons.w):
        column[3] *= 1 + 2e-6 * sign
    with pytest.raises(FailedError, match="number 103 has a direction"):
        check(muons)


def test_the_first_of_several_bad_muons_is_named():
    muons = good_muons()
    muons.pdg_id[5] = 0
    muons.kinetic_energy[9] = -1
    with pytest.raises(FailedError, match="number 105"):
        check(muons)
