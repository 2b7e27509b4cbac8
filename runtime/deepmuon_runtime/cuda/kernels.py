"""What a GPU does that neither the network nor CuPy does, in CUDA C++ that CuPy compiles for the card at hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from deepmuon_runtime.latents.philox import FOR_ATTEMPTS, FOR_TIMES
from deepmuon_runtime.muons import Muons
from deepmuon_runtime.physical import squared_length_tolerance

__all__ = ["KERNELS", "WHERE_BITS", "Kernels"]

WHERE_BITS = 53
"""Bits of a moment that say where in its slot it is; those above are the slot's."""

NAMES = ("fill_latents", "fill_again", "fill_moments", "take_muons", "find_bad")
THREADS = 256  # of a block of CUDA's
NONE_IS_BAD = 2**64 - 1


class Kernels:
    """The kernels, compiled. Arrays are CuPy's, contiguous; seeds and streams are 0 to 2^64 - 1."""

    def __init__(self) -> None:
        import cupy

        self._cupy = cupy
        module = cupy.RawModule(code=KERNELS)
        self._compiled = {name: module.get_function(name) for name in NAMES}

    def fill_latents(self, latent: Any, seed: int, stream: int, purpose: int, first: int) -> None:
        """Fill an array as `latents.philox.fill_latents` does, to the bit.

        Parameters
        ----------
        latent : float32
            What is to be filled.
        seed, stream, purpose
            Which row of words.
        first
            Which half of a word is the first, counted from the beginning of the row.
        """
        counters = -(-latent.size // 8) + 1  # one more where the first is cut
        self._launch("fill_latents", counters, seed, stream, purpose, first, latent.size, latent)

    def fill_again(self, numbers: Any, seed: int, stream: int, attempts: Any, draws: Any) -> None:
        """Fill an array as `latents.again.numbers_again` makes it, to the bit.

        Parameters
        ----------
        numbers : float32 [n, size]
            What is to be filled.
        seed, stream
            Which rows of words.
        attempts, draws : int64 [n]
            Which attempts of which draws.
        """
        n, size = numbers.shape
        counters = n * -(-size // 8)
        self._launch("fill_again", counters, seed, stream, FOR_ATTEMPTS, attempts, draws, n, size, numbers)

    def fill_moments(self, moments: Any, seed: int, stream: int, first: int, slot: int) -> None:
        """Fill an array with when muons of a slot of time come, not sorted.

        Parameters
        ----------
        moments : uint64
            What is to be filled: the slot's number, and in the lowest WHERE_BITS where in the slot.
        seed, stream, first
            Which words, and which of them is the first.
        slot
            What stands above these bits, below 2^11.
        """
        counters = -(-moments.size // 4) + 1
        self._launch("fill_moments", counters, seed, stream, FOR_TIMES, first, moments.size, slot, moments)

    def take_muons(self, outputs: tuple[Any, Any, Any], skipped: int, muons: Muons) -> None:
        """Cut a network's outputs into columns: energy [n], direction [n, 3] and charge [n], the first left out."""
        columns = muons.kinetic_energy, muons.u, muons.v, muons.w, muons.pdg_id
        self._launch("take_muons", len(muons), skipped, len(muons), *outputs, *columns)

    def first_bad(self, muons: Muons, energy_min_gev: float, energy_max_gev: float) -> int | None:
        """Return the position of the first muon that `physical.find_unphysical` finds fault with; None without one."""
        found = self._cupy.empty(1, np.uint64)
        found.fill(NONE_IS_BAD)
        limits = np.float32(energy_min_gev), np.float32(energy_max_gev), squared_length_tolerance()
        columns = muons.kinetic_energy, muons.u, muons.v, muons.w, muons.pdg_id
        self._launch("find_bad", len(muons), len(muons), *columns, *limits, found)
        first = int(found.get()[0])
        return None if first == NONE_IS_BAD else first

    def _launch(self, name: str, threads: int, *arguments: Any) -> None:
        """Run a kernel on so many threads; whole numbers are uint64."""
        if threads:
            passed = tuple(np.uint64(one) if isinstance(one, int) else one for one in arguments)
            self._compiled[name]((-(-threads // THREADS),), (THREADS,), passed)


KERNELS = r"""
typedef unsigned int uint32;
typedef unsigned long long uint64;
typedef long long int64;

// Philox4x64-10: four words of a counter and a key of two. Salmon et al., SC 2011; the constants are the paper's.
__device__ void philox(uint64 words[4], uint64 key_0, uint64 key_1)
{
    const uint64 multiplier_0 = 0xD2E7470EE14C6C93ull, multiplier_1 = 0xCA5A826395121157ull;
    for (int round = 0; round < 10; ++round) {
        const uint64 high_0 = __umul64hi(multiplier_0, words[0]), low_0 = multiplier_0 * words[0];
        const uint64 high_1 = __umul64hi(multiplier_1, words[2]), low_1 = multiplier_1 * words[2];
        words[0] = high_1 ^ words[1] ^ key_0;
        words[1] = low_1;
        words[2] = high_0 ^ words[3] ^ key_1;
        words[3] = low_0;
        key_0 += 0x9E3779B97F4A7C15ull;
        key_1 += 0xBB67AE8584CAA73Bull;
    }
}

__device__ uint64 this_thread() { return blockIdx.x * (uint64)blockDim.x + threadIdx.x; }

// The latent of one of the eight halves of four words.
__device__ float latent_of(const uint64 words[4], int half)
{
    const uint32 bits = (uint32)(words[half / 2] >> 32 * (half % 2));
    return (float)(int)((bits & 0xFFFFFF00u) | 0x80u) * 4.656612873077393e-10f;  // 2^-31
}

// Half-words first to first + count - 1 of a row; a thread has the eight of one counter.
extern "C" __global__ void fill_latents(
    uint64 seed, uint64 stream, uint64 purpose, uint64 first, uint64 count, float* latents)
{
    const uint64 counter = first / 8 + this_thread();
    if (8 * counter >= first + count) return;
    uint64 words[4] = {counter + 1, 0, 0, purpose};
    philox(words, seed, stream);
    for (int half = 0; half < 8; ++half) {
        const uint64 number = 8 * counter + half;
        if (number >= first && number < first + count) latents[number - first] = latent_of(words, half);
    }
}

// The numbers of some draws at later attempts; a thread has those of one counter of a draw.
extern "C" __global__ void fill_again(
    uint64 seed, uint64 stream, uint64 purpose, const int64* attempts, const int64* draws, uint64 count, uint64 size,
    float* numbers)
{
    const uint64 counters = (size + 7) / 8;
    const uint64 row = this_thread() / counters, counter = this_thread() % counters;
    if (row >= count) return;
    uint64 words[4] = {(uint64)draws[row] * counters + counter + 1, 0, (uint64)attempts[row], purpose};
    philox(words, seed, stream);
    for (int half = 0; half < 8; ++half) {
        const uint64 number = 8 * counter + half;
        if (number < size) numbers[row * size + number] = latent_of(words, half);
    }
}

// Words first to first + count - 1 of a row, their upper 53 bits under a slot; a thread has the four of one counter.
extern "C" __global__ void fill_moments(
    uint64 seed, uint64 stream, uint64 purpose, uint64 first, uint64 count, uint64 slot, uint64* moments)
{
    const uint64 counter = first / 4 + this_thread();
    if (4 * counter >= first + count) return;
    uint64 words[4] = {counter + 1, 0, 0, purpose};
    philox(words, seed, stream);
    for (int word = 0; word < 4; ++word) {
        const uint64 number = 4 * counter + word;
        if (number >= first && number < first + count) moments[number - first] = slot << 53 | words[word] >> 11;
    }
}

// Muons skipped to skipped + count - 1 of the network's, as columns; a thread has one of them.
extern "C" __global__ void take_muons(
    uint64 skipped, uint64 count, const float* energy, const float* direction, const signed char* charge,
    float* kinetic_energy, float* u, float* v, float* w, signed char* pdg_id)
{
    const uint64 place = this_thread();
    if (place >= count) return;
    const uint64 source = skipped + place;
    kinetic_energy[place] = energy[source];
    u[place] = direction[3 * source];
    v[place] = direction[3 * source + 1];
    w[place] = direction[3 * source + 2];
    pdg_id[place] = (signed char)(-13 * charge[source]);
}

// The lowest position of a muon that can't be one; a thread looks at one muon.
extern "C" __global__ void find_bad(
    uint64 count, const float* kinetic_energy, const float* u, const float* v, const float* w,
    const signed char* pdg_id, float energy_min, float energy_max, float tolerance, uint64* first_bad)
{
    const uint64 place = this_thread();
    if (place >= count) return;
    const float e = kinetic_energy[place], x = u[place], y = v[place], z = w[place];
    const int id = pdg_id[place];
    const float excess = fabsf(x * x + y * y + z * z - 1.0f);
    // So written that a NaN is bad: no comparison with it is true.
    const bool good =
        e >= energy_min && e <= energy_max && excess <= tolerance && z < 0.0f && (id == 13 || id == -13);
    if (!good) atomicMin(first_bad, place);
}
"""
"""The kernels' source."""
