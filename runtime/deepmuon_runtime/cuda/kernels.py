"""What a GPU does beside the network, in CUDA C++ that CuPy compiles for the card at hand.

`fill_latents` is `deepmuon_runtime.latents.philox.fill_latents`, to the bit. `take_muons` cuts a network's outputs into
columns and looks at each muon as `deepmuon_runtime.physical.find_unphysical` does.
"""

from __future__ import annotations

__all__ = ["FILL_LATENTS", "KERNELS", "TAKE_MUONS", "THREADS", "blocks"]

FILL_LATENTS = "fill_latents"
"""Arguments: seed, stream, first half-word, how many (uint64 each); latents (float32, out)."""

TAKE_MUONS = "take_muons"
"""Arguments: muons skipped, how many (uint64); energy, direction, charge of the network; lowest and highest energy,
tolerance of a squared length (float32); energy, u, v, w, pdg_id (out); position of the first bad muon (uint64, the
lowest is kept)."""

THREADS = 256
"""Threads of a block of CUDA's."""


def blocks(threads: int) -> int:
    """Return how many of CUDA's blocks hold so many threads."""
    return -(-threads // THREADS)


KERNELS = r"""
typedef unsigned int uint32;
typedef unsigned long long uint64;

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

// Half-words first to first + count - 1 of the row of the latents; a thread has the eight of one counter.
extern "C" __global__ void fill_latents(uint64 seed, uint64 stream, uint64 first, uint64 count, float* latents)
{
    const uint64 counter = first / 8 + blockIdx.x * (uint64)blockDim.x + threadIdx.x;
    if (8 * counter >= first + count) return;
    uint64 words[4] = {counter + 1, 0, 0, 0};
    philox(words, seed, stream);
    for (int half = 0; half < 8; ++half) {
        const uint64 number = 8 * counter + half;
        if (number < first || number >= first + count) continue;
        const uint32 bits = (uint32)(words[half / 2] >> 32 * (half % 2));
        latents[number - first] = (float)(int)((bits & 0xFFFFFF00u) | 0x80u) * 4.656612873077393e-10f;  // 2^-31
    }
}

// Muons skipped to skipped + count - 1 of the network's, as columns; a thread has one of them.
extern "C" __global__ void take_muons(
    uint64 skipped, uint64 count, const float* energy, const float* direction, const signed char* charge,
    float energy_min, float energy_max, float tolerance,
    float* kinetic_energy, float* u, float* v, float* w, signed char* pdg_id, uint64* first_bad)
{
    const uint64 place = blockIdx.x * (uint64)blockDim.x + threadIdx.x;
    if (place >= count) return;
    const uint64 source = skipped + place;
    const float e = energy[source];
    const float x = direction[3 * source], y = direction[3 * source + 1], z = direction[3 * source + 2];
    const int q = charge[source];
    kinetic_energy[place] = e;
    u[place] = x;
    v[place] = y;
    w[place] = z;
    pdg_id[place] = (signed char)(-13 * q);
    const float excess = fabsf(x * x + y * y + z * z - 1.0f);
    // So written that a NaN is bad: no comparison with it is true.
    const bool good = e >= energy_min && e <= energy_max && excess <= tolerance && z < 0.0f && (q == 1 || q == -1);
    if (!good) atomicMin(first_bad, place);
}
"""
"""The kernels' source."""
