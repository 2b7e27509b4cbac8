// deepmuon-sample MODEL N SEED [DEPTH]: writes N muons as CSV, those of deepmuon-gen; what the model says of itself goes to the standard error.

#include <charconv>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>

#include "deepmuon.hpp"

namespace {

std::uint64_t whole_number(const std::string& text) {
    std::uint64_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end != text.data() + text.size()) {
        throw std::runtime_error(text + " is no whole number");
    }
    return number;
}

float metres(const std::string& text) {
    std::istringstream stream(text);
    stream.imbue(std::locale::classic());
    float depth = 0;
    if (!(stream >> depth) || !stream.eof()) {
        throw std::runtime_error(text + " is no number of metres");
    }
    return depth;
}

} // namespace

int main(int argc, char** argv) try {
    if (argc != 4 && argc != 5) {
        std::fprintf(stderr, "usage: deepmuon-sample MODEL N SEED [DEPTH] > muons.csv\n");
        return 2;
    }
    const std::uint64_t count = whole_number(argv[2]);
    const std::uint64_t seed = whole_number(argv[3]);
    deepmuon::Generator generator =
        argc == 5 ? deepmuon::Generator(argv[1], metres(argv[4])) : deepmuon::Generator(argv[1]);
    std::fprintf(stderr, "%s, %s m of %s\n", generator.metadata("architecture").c_str(),
                 generator.metadata("depth_m").c_str(), generator.metadata("medium").c_str());
    std::printf("kinetic_energy,u,v,w,pdg_id\n");
    for (const deepmuon::Muon& muon : generator.sample(count, generator.random(seed))) {
        std::printf("%.9g,%.9g,%.9g,%.9g,%d\n", muon.kinetic_energy, muon.u, muon.v, muon.w, muon.pdg_id());
    }
    return 0;
} catch (const std::exception& error) {
    std::fprintf(stderr, "deepmuon-sample: %s\n", error.what());
    return 1;
}
