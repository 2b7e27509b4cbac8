#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace deepmuon {

struct Muon {
    float kinetic_energy; // GeV
    float u, v, w;        // direction of motion, a unit vector; z is up, so w < 0
    int charge;           // -1 or +1

    int pdg_id() const { return charge > 0 ? -13 : 13; }
};

// Puts a model's three outputs together.
inline std::vector<Muon> muons(std::size_t count, const float* energy, const float* direction,
                               const std::int8_t* charge) {
    std::vector<Muon> muons;
    muons.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
        muons.push_back({energy[i], direction[3 * i], direction[3 * i + 1], direction[3 * i + 2], charge[i]});
    }
    return muons;
}

} // namespace deepmuon
