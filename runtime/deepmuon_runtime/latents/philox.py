"""Random numbers: the same for ever, and at any position at once.

A seed and a stream, which belongs to the model (`deepmuon_runtime.latents.stream`), open rows of 64-bit words, one
for each purpose. Word j of a row is word j mod 4 of Philox4x64-10 (Salmon et al., "Parallel random numbers: as easy
as 1, 2, 3", SC 2011) at the counter (j // 4 + 1, 0, 0, purpose) under the key (seed, stream). That is the sequence of
`numpy.random.Philox(key=seed + (stream << 64), counter=purpose << 192).random_raw()`, which numpy promises never to
change, unlike the methods of its Generator.
"""

from __future__ import annotations

import operator
import secrets

import numpy as np
from numpy.random import Philox
from numpy.typing import NDArray

from deepmuon_runtime.errors import RefusedError

__all__ = [
    "FOR_ATTEMPTS",
    "FOR_COUNT",
    "FOR_LATENTS",
    "FOR_POSITIONS",
    "FOR_TIMES",
    "LARGEST_SEED",
    "checked_seed",
    "fill_latents",
    "latents",
    "new_seed",
    "words",
]

FOR_LATENTS = 0
"""The purpose of the words that make latents."""

FOR_COUNT = 1
"""The purpose of the words that decide how many muons a live time gives."""

FOR_POSITIONS = 2
"""The purpose of the words that put muons on a plane, or where they enter a target."""

FOR_TIMES = 3
"""The purpose of the words that say when muons come."""

FOR_ATTEMPTS = 4
"""The purpose of the words of draws that were rejected and are made again (`again`)."""

LARGEST_SEED = 2**64 - 1

PIECE = 5 << 13  # words made at once, 320 kB: they stay in the cache

# Of both halves of a word at once: the upper 24 bits s of each, and 1/2 after them.
UPPER_24_BITS = np.uint64(0xFFFFFF00_FFFFFF00)
ONE_HALF = np.uint64(0x00000080_00000080)


def new_seed() -> int:
    """Return a seed from the operating system's randomness, from 0 to 2^63 - 1."""
    return secrets.randbits(63)


def checked_seed(seed: int) -> int:
    """Return the seed if it is one, a whole number from 0 to 2^64 - 1, else raise RefusedError."""
    try:
        whole = operator.index(seed)
    except TypeError as error:
        raise RefusedError(f"the seed {seed!r} is not a whole number, as 1 and 12345 are") from error
    if not 0 <= whole <= LARGEST_SEED:
        raise RefusedError(f"the seed {seed} is not from 0 to 2^64 - 1 ({LARGEST_SEED})")
    return whole


def words(seed: int, stream: int, purpose: int, first: int, count: int) -> NDArray[np.uint64]:
    """Return words `first` to `first + count - 1` of a row.

    Parameters
    ----------
    seed, stream
        0 to 2^64 - 1.
    purpose
        `FOR_LATENTS`, `FOR_COUNT`, `FOR_POSITIONS` or `FOR_TIMES`.
    first, count
        Which words.

    Returns
    -------
    uint64 [count]
    """
    philox, skipped = _philox(seed, stream, purpose, first)
    return philox.random_raw(skipped + count)[skipped:]


def latents(seed: int, first: int, draws: int, latent_size: int, stream: int = 0) -> NDArray[np.float32]:
    """Return the latents of consecutive draws: independent, uniform, strictly inside (-1, 1).

    Latent j of draw d is half-word h = d latent_size + j of the row: the low 32 bits of word h // 2 if h
    is even, the high ones if it is odd. With s its upper 24 bits as a signed number, the latent is
    (s + 1/2) / 2^23, an odd multiple of 2^-24, which float32 holds exactly.

    Parameters
    ----------
    seed
        0 to 2^64 - 1.
    first, draws
        Which draws.
    latent_size
        Latents of a draw.
    stream
        That of the model whose muons they make, 0 to 2^64 - 1; 0 where there is none.

    Returns
    -------
    float32 [draws, latent_size]
    """
    latent = np.empty((draws, latent_size), np.float32)
    fill_latents(latent, seed, first, stream)
    return latent


def fill_latents(
    latent: NDArray[np.float32],
    seed: int,
    first: int,
    stream: int = 0,
    *,
    purpose: int = FOR_LATENTS,
) -> None:
    """Fill an array with the latents of consecutive draws, or numbers like them for another purpose; see `latents`.

    Parameters
    ----------
    latent : float32 [draws, latent_size], contiguous
        What is to be filled.
    seed
        0 to 2^64 - 1.
    first
        The first of the draws.
    stream
        As in `latents`.
    purpose
        As in `words`.
    """
    flat = latent.reshape(-1)
    first_word, skipped = divmod(first * latent.shape[1], 2)
    philox, skipped_words = _philox(seed, stream, purpose, first_word)
    skipped += 2 * skipped_words
    done = 0
    while done < len(flat):
        raw = philox.random_raw(min(PIECE, (skipped + len(flat) - done + 1) // 2))
        raw &= UPPER_24_BITS
        raw |= ONE_HALF
        halves = raw.astype("<u8", copy=False).view("<i4")[skipped : skipped + len(flat) - done]
        part = flat[done : done + len(halves)]
        # In one pass over the memory; the multiplication, by a power of 2, is exact.
        np.multiply(halves, np.float32(2.0**-31), out=part, dtype=np.float32, casting="unsafe")
        done += len(part)
        skipped = 0


def _philox(seed: int, stream: int, purpose: int, first: int) -> tuple[Philox, int]:
    """Return a generator at or just before a word, and how many words are to be skipped."""
    counter, skipped = divmod(first, 4)  # numpy counts up before it gives the first word
    return Philox(key=seed + (stream << 64), counter=counter + (purpose << 192)), skipped
