from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import cuda_emulation

from deepmuon_runtime.cuda.kernels import Kernels
from deepmuon_runtime.latents.again import numbers_again
from deepmuon_runtime.latents.philox import LARGEST_SEED, fill_latents
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import first_unphysical, squared_length_tolerance

keys = st.integers(0, LARGEST_SEED)


@pytest.fixture(scope="module")
def kernels() -> Iterator[Kernels]:
    with pytest.MonkeyPatch.context() as patch:
        for name, module in cuda_emulation.modules().items():
            patch.setitem(sys.modules, name, module)
        yield Kernels()


@given(
    seed=keys,
    stream=keys,
    purpose=st.integers(0, 4),
    first=st.integers(0, 2**53),
    draws=st.integers(1, 60),
    latent_size=st.integers(1, 9),
)
def test_the_latents_of_a_gpu_are_those_of_the_processor_to_the_bit(
    kernels, seed, stream, purpose, first, draws, latent_size
):
    expected = np.empty((draws, latent_size), np.float32)
    fill_latents(expected, seed, first, stream, purpose=purpose)
    found = cuda_emulation.array((draws, latent_size), np.float32)
    kernels.fill_latents(found, seed, stream, purpose, first * latent_size)
    assert np.array_equal(found.get(), expected)


@given(
    seed=keys,
    stream=keys,
    draws=st.lists(st.integers(0, 2**53), min_size=1, max_size=30),
    attempts=st.lists(st.integers(1, 2**40), min_size=1, max_size=3),
    size=st.integers(1, 40),
)
def test_the_numbers_of_draws_made_again_are_those_of_the_processor_to_the_bit(
    kernels, seed, stream, draws, attempts, size
):
    draw, attempt = np.array([(draw, attempt) for draw in sorted(draws) for attempt in attempts]).T.copy()
    found = cuda_emulation.array((len(draw), size), np.float32)
    kernels.fill_again(found, seed, stream, cuda_emulation.Array(attempt), cuda_emulation.Array(draw))
    assert np.array_equal(found.get(), numbers_again(seed, stream, attempt, draw, size))


def outputs(n: int) -> tuple[np.ndarray, ...]:
    """Energies, directions and charges of good muons, as a network gives them."""
    random = np.random.default_rng(5)
    drawn = random.normal(size=(n, 3))
    drawn[:, 2] = -np.abs(drawn[:, 2])
    direction = drawn / np.linalg.norm(drawn, axis=1, keepdims=True)
    return np.float32(random.uniform(1, 10, n)), np.float32(direction), np.int8(random.choice([-1, 1], n))


def taken(kernels: Kernels, given: tuple[np.ndarray, ...], skipped: int, count: int) -> tuple[Muons, int | None]:
    """Muons as columns, and the position of the first bad one."""
    muons = Muons.empty(count, column=cuda_emulation.array)
    kernels.take_muons(tuple(map(cuda_emulation.Array, given)), skipped, muons)
    first_bad = kernels.first_bad(muons, 1, 10)
    return Muons(**{name: column.get() for name, column in muons.columns.items()}), first_bad


def test_muons_are_cut_out_of_a_block_as_columns(kernels):
    energy, direction, charge = outputs(1000)
    muons, first_bad = taken(kernels, (energy, direction, charge), 300, 500)
    kept = slice(300, 800)
    assert first_bad is None
    assert np.array_equal(muons.kinetic_energy, energy[kept])
    assert np.array_equal(np.stack([muons.u, muons.v, muons.w], axis=1), direction[kept])
    assert np.array_equal(muons.charge, charge[kept])


BAD = [
    ("energy", np.nan),
    ("energy", 0.999),
    ("energy", 10.001),
    ("energy", np.inf),
    ("u", np.nan),
    ("u", np.inf),
    ("u", 0.3),
    ("w", 0.0),
    ("w", 1.0),
    ("charge", 0),
    ("charge", 2),
    ("charge", -128),
]


@pytest.mark.parametrize(("what", "value"), BAD)
@pytest.mark.parametrize("place", [0, 299, 410])
def test_a_gpu_finds_the_bad_muon_that_the_processor_finds(kernels, what, value, place):
    energy, direction, charge = outputs(500)
    for where in (place, 450):  # the first counts
        if what == "energy":
            energy[where] = value
        elif what == "charge":
            charge[where] = value
        else:
            direction[where] = (value, 0, -1) if what == "u" else (0, 0, value)
    muons, first_bad = taken(kernels, (energy, direction, charge), 0, 500)
    found = first_unphysical(muons, 1, 10)
    assert found is not None
    assert first_bad == found[0] == place


@pytest.mark.parametrize(("excess", "is_bad"), [(0.9, False), (1.1, True)])
def test_a_gpu_has_the_processors_tolerance_of_a_length(kernels, excess, is_bad):
    energy, direction, charge = outputs(10)
    direction[4] = (0, 0, -np.sqrt(1 + excess * float(squared_length_tolerance())))
    _, first_bad = taken(kernels, (energy, direction, charge), 0, 10)
    assert (first_bad == 4) is is_bad
