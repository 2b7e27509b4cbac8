#pragma once

#include <array>
#include <cstdint>

namespace deepmuon {

// The random numbers of deepmuon-gen, 32 bits at a time: Philox4x64-10 (J. Salmon et al., "Parallel random numbers: as
// easy as 1, 2, 3", SC 2011), as docs/random_numbers.md has it. A random number engine for the standard library too.
class Philox {
public:
    using result_type = std::uint32_t;

    Philox(std::uint64_t seed, std::uint64_t stream) : seed_(seed), stream_(stream) {}

    static constexpr result_type min() { return 0; }
    static constexpr result_type max() { return 0xffffffff; }

    result_type operator()() {
        const std::uint64_t counter = next_ / 8 + 1, half = next_ % 8;
        if (counter != counter_) {
            make(counter);
        }
        ++next_;
        return static_cast<result_type>(words_[half / 2] >> (half % 2 * 32));
    }

    // Leaves so many out, at once.
    void discard(std::uint64_t count) { next_ += count; }

private:
    void make(std::uint64_t counter) {
        constexpr std::uint64_t first = 0xd2e7470ee14c6c93, second = 0xca5a826395121157;
        std::uint64_t seed = seed_, stream = stream_;
        auto& [a, b, c, d] = words_ = {counter, 0, 0, 0}; // the last is the purpose: 0 is for the latents
        for (int round = 0; round < 10; ++round) {
            words_ = {upper(second, c) ^ b ^ seed, second * c, upper(first, a) ^ d ^ stream, first * a};
            seed += 0x9e3779b97f4a7c15;
            stream += 0xbb67ae8584caa73b;
        }
        counter_ = counter;
    }

    // The upper 64 bits of a product.
    static std::uint64_t upper(std::uint64_t a, std::uint64_t b) {
        const std::uint64_t a0 = a & 0xffffffff, a1 = a >> 32, b0 = b & 0xffffffff, b1 = b >> 32;
        const std::uint64_t middle = a1 * b0 + (a0 * b0 >> 32);
        return a1 * b1 + (middle >> 32) + ((a0 * b1 + (middle & 0xffffffff)) >> 32);
    }

    std::uint64_t seed_, stream_, next_ = 0, counter_ = 0;
    std::array<std::uint64_t, 4> words_{};
};

} // namespace deepmuon
