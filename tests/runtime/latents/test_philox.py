from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deepmuon_runtime import RefusedError
from deepmuon_runtime.latents.philox import LARGEST_SEED, checked_seed, latents, new_seed, words

SEEDS = st.integers(0, LARGEST_SEED)
MASK = 2**64 - 1


def philox4x64(counter: list[int], key: list[int]) -> list[int]:
    """Philox4x64-10 straight from the paper (Salmon et al. 2011), one block of four words."""
    for _ in range(10):
        first, second = 0xD2E7470EE14C6C93 * counter[0], 0xCA5A826395121157 * counter[2]
        counter = [
            (second >> 64) ^ counter[1] ^ key[0],
            second & MASK,
            (first >> 64) ^ counter[3] ^ key[1],
            first & MASK,
        ]
        key = [(key[0] + 0x9E3779B97F4A7C15) & MASK, (key[1] + 0xBB67AE8584CAA73B) & MASK]
    return counter


def test_the_reference_gives_the_published_vectors_of_random123():
    assert philox4x64([0] * 4, [0] * 2) == [
        0x16554D9ECA36314C,
        0xDB20FE9D672D0FDC,
        0xD7E772CEE186176B,
        0x7E68B68AEC7BA23B,
    ]
    assert philox4x64([MASK] * 4, [MASK] * 2) == [
        0x87B092C3013FE90B,
        0x438C3C67BE8D0224,
        0x9CC7D7C69CD777B6,
        0xA09CAEBF594F0BA0,
    ]


@given(seed=SEEDS, stream=SEEDS, purpose=st.integers(0, 3), first=st.integers(0, 2**60), count=st.integers(1, 9))
def test_words_are_philox_at_the_documented_counter(seed, stream, purpose, first, count):
    expected = [philox4x64([j // 4 + 1, 0, 0, purpose], [seed, stream])[j % 4] for j in range(first, first + count)]
    assert words(seed, stream, purpose, first, count).tolist() == expected


@given(seed=SEEDS, stream=SEEDS, first=st.integers(0, 2**50), latent_size=st.integers(1, 7))
def test_latents_follow_the_documented_formula(seed, stream, first, latent_size):
    def expected(half: int) -> float:
        word = philox4x64([half // 8 + 1, 0, 0, 0], [seed, stream])[half // 2 % 4]
        bits = word >> 32 if half % 2 else word & 0xFFFFFFFF
        upper = (bits >> 8) - (2**24 if bits >> 31 else 0)
        return (upper + 0.5) / 2**23

    found = latents(seed, first, 3, latent_size, stream)
    assert found.shape == (3, latent_size)
    assert found.dtype == np.float32
    assert found.ravel().tolist() == [expected(half) for half in range(first * latent_size, (first + 3) * latent_size)]


def test_the_first_latents_of_seed_1_stay_what_they_are():
    assert [value.hex() for value in latents(1, 0, 1, 4)[0].tolist()] == [
        "0x1.d58a0a0000000p-1",
        "0x1.36da8a0000000p-1",
        "-0x1.1507c60000000p-1",
        "-0x1.35d82c0000000p-2",
    ]


@given(seed=SEEDS, first=st.integers(0, 1000), draws=st.integers(1, 50), latent_size=st.integers(1, 1500))
def test_any_piece_of_a_stream_is_what_the_whole_has_there(seed, first, draws, latent_size):
    whole = latents(seed, 0, first + draws, latent_size)
    assert np.array_equal(latents(seed, first, draws, latent_size), whole[first:])


def test_latents_are_uniform_strictly_inside_their_interval():
    """One false alarm in a million: chi2 of 256 cells has mean 255, standard deviation 22.6."""
    values = latents(7, 0, 1 << 20, 1).ravel()
    assert np.abs(values).max() < 1
    assert np.array_equal(np.float64(values) * 2**24 % 2, np.ones(len(values)))
    counts = np.bincount(((values + 1) * 128).astype(int), minlength=256)
    expected = len(values) / 256
    assert ((counts - expected) ** 2 / expected).sum() < 255 + 5 * 22.6


def test_seeds_streams_and_purposes_share_no_words():
    ends = (0, 1, LARGEST_SEED)
    samples = [words(seed, stream, purpose, 0, 10_000) for seed in ends for stream in ends for purpose in (0, 1)]
    together = np.concatenate(samples)
    assert len(np.unique(together)) == len(together)


def test_new_seeds_are_seeds_and_differ():
    seeds = {new_seed() for _ in range(100)}
    assert len(seeds) == 100
    assert all(0 <= seed < 2**63 for seed in seeds)


@pytest.mark.parametrize("seed", [-1, 2**64])
def test_a_seed_out_of_range_is_refused(seed):
    with pytest.raises(RefusedError, match="is not from 0 to"):
        checked_seed(seed)
