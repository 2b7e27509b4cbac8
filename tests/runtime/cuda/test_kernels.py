from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import cuda_emulation

from deepmuon_runtime.cuda.kernels import FILL_LATENTS, KERNELS, TAKE_MUONS, THREADS, blocks
from deepmuon_runtime.latents.philox import LARGEST_SEED, latents
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import first_unphysical, squared_length_tolerance

NONE_IS_BAD = 2**64 - 1

keys = st.integers(0, LARGEST_SEED)


@pytest.fixture(scope="module")
def kernels() -> cuda_emulation.RawModule:
    return cuda_emulation.RawModule(KERNELS)


def launch(kernels: cuda_emulation.RawModule, name: str, threads: int, *arguments: object) -> None:
    kernels.get_function(name)((blocks(threads),), (THREADS,), arguments)


@given(seed=keys, stream=keys, first=st.integers(0, 2**53), draws=st.integers(1, 60), latent_size=st.integers(1, 9))
def test_the_latents_of_a_gpu_are_those_of_the_processor_to_the_bit(kernels, seed, stream, first, draws, latent_size):
    found = cuda_emulation.array((draws, latent_size), np.float32)
    begin, size = first * latent_size, found.size
    threads = -(-size // 8) + 1
    launch(kernels, FILL_LATENTS, threads, *map(np.uint64, (seed, stream, begin, size)), found)
    assert np.array_equal(found, latents(seed, first, draws, latent_size, stream))


def outputs(n: int) -> tuple[cuda_emulation.Array, ...]:
    """Energies, directions and charges of good muons, as a network gives them."""
    random = np.random.default_rng(5)
    energy, direction, charge = (
        cuda_emulation.array(shape, kind) for shape, kind in ((n, "f4"), ((n, 3), "f4"), (n, "i1"))
    )
    energy[:] = random.uniform(1, 10, n)
    drawn = random.normal(size=(n, 3))
    drawn[:, 2] = -np.abs(drawn[:, 2])
    direction[:] = drawn / np.linalg.norm(drawn, axis=1, keepdims=True)
    charge[:] = random.choice([-1, 1], n)
    return energy, direction, charge


def taken(kernels: cuda_emulation.RawModule, given: tuple, skipped: int, count: int) -> tuple[Muons, int]:
    columns = [cuda_emulation.array(count, kind) for kind in ("f4", "f4", "f4", "f4", "i1")]
    first_bad = cuda_emulation.array(1, np.uint64)
    first_bad.fill(NONE_IS_BAD)
    limits = np.float32(1), np.float32(10), squared_length_tolerance()
    sizes = np.uint64(skipped), np.uint64(count)
    launch(kernels, TAKE_MUONS, count, *sizes, *given, *limits, *columns, first_bad)
    return Muons(*columns), int(first_bad[0])


def test_muons_are_cut_out_of_a_block_as_columns(kernels):
    energy, direction, charge = outputs(1000)
    muons, first_bad = taken(kernels, (energy, direction, charge), 300, 500)
    kept = slice(300, 800)
    assert first_bad == NONE_IS_BAD
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
