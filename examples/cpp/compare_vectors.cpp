// compare-vectors MODEL VECTORS: whether a model gives the muons of its test vectors (tests/vectors), within the
// tolerances of docs/embedding.md.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "deepmuon.hpp"

namespace {

std::string read(const std::string& path) {
    std::ifstream file(path);
    if (!file) {
        throw std::runtime_error("cannot read " + path);
    }
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

// The numbers of "key": [ ... ] in JSON whose arrays are flat.
std::vector<double> numbers(const std::string& json, const std::string& key) {
    const std::size_t start = json.find("\"" + key + "\": [");
    if (start == std::string::npos) {
        throw std::runtime_error("the test vectors have no " + key);
    }
    std::vector<double> numbers;
    for (const char* next = json.c_str() + json.find('[', start); *next != ']';) {
        char* end;
        numbers.push_back(std::strtod(next + 1, &end));
        next = end;
    }
    return numbers;
}

} // namespace

int main(int argc, char** argv) try {
    if (argc != 3) {
        std::fprintf(stderr, "usage: compare-vectors MODEL VECTORS\n");
        return 2;
    }
    const std::string json = read(argv[2]);
    const auto latents = numbers(json, "latent"), energy = numbers(json, "kinetic_energy"),
               direction = numbers(json, "direction"), charge = numbers(json, "charge");
    std::vector<float> input(latents.begin(), latents.end());
    const auto muons = deepmuon::Generator(argv[1]).run(input);
    if (muons.size() != energy.size()) {
        throw std::runtime_error("the model gave " + std::to_string(muons.size()) + " muons instead of " +
                                 std::to_string(energy.size()));
    }

    double energy_difference = 0, direction_difference = 0;
    int charges = 0;
    for (std::size_t i = 0; i < muons.size(); ++i) {
        const auto& muon = muons[i];
        energy_difference = std::fmax(energy_difference, std::fabs(muon.kinetic_energy / energy[i] - 1));
        for (const auto& [found, axis] : {std::pair{muon.u, 0}, std::pair{muon.v, 1}, std::pair{muon.w, 2}}) {
            direction_difference = std::fmax(direction_difference, std::fabs(found - direction[3 * i + axis]));
        }
        charges += muon.charge != charge[i];
    }
    std::printf("%s: %zu muons, energy %.1e, direction %.1e, charges %d\n", argv[1], muons.size(), energy_difference,
                direction_difference, charges);
    return energy_difference <= 2e-5 && direction_difference <= 2e-6 && charges == 0 ? 0 : 1;
} catch (const std::exception& error) {
    std::fprintf(stderr, "compare-vectors: %s\n", error.what());
    return 2;
}
