// Cosmic-ray muons from a DeepMuon model, in C++17; header only.
//
//     deepmuon::Generator generator("quantile-10m.onnx");
//     deepmuon::Philox random = generator.random(1);
//     for (const deepmuon::Muon& muon : generator.sample(1000, random)) { ... }
//
// Of a family, which has any depth in its range: Generator generator("family.onnx", 13.7f).
//
// These are the muons of `deepmuon-gen --seed 1`. Any other source of 32 random bits will do, such as a std::mt19937.
//
// OpenVINO runs the model where DEEPMUON_OPENVINO is defined, else ONNX Runtime. Errors are exceptions: what the engine
// throws, which is a std::exception, or std::runtime_error if the file is no DeepMuon model.

#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iomanip>
#include <locale>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "family.hpp"
#include "muon.hpp"
#include "philox.hpp"
#include "stream.hpp"
#ifdef DEEPMUON_OPENVINO
#include "engine_openvino.hpp"
#else
#include "engine_onnxruntime.hpp"
#endif

namespace deepmuon {

// A latent from 32 random bits, uniform and strictly inside (-1, 1): with s their upper 24 as a signed number, it is
// (2 s + 1) / 2^24, which float holds exactly.
inline float latent(std::uint32_t bits) {
    return static_cast<float>(2 * (static_cast<std::int32_t>(bits) >> 8) + 1) / (1 << 24);
}

class Generator {
public:
    // A model of one depth, or a family at the depth that stands in it.
    explicit Generator(const std::string& model) : Generator(model, read_file(model)) {}

    // A family at any depth in its range, in metres of its medium.
    Generator(const std::string& model, float depth) : Generator(model, at_depth(read_file(model), depth)) {
        const auto least = static_cast<float>(number("depth_min_m")), most = static_cast<float>(number("depth_max_m"));
        if (!(least <= depth && depth <= most)) {
            throw std::runtime_error(model + " has depths from " + metadata("depth_min_m") + " to " +
                                     metadata("depth_max_m") + " m, and not " + text(depth));
        }
        metadata_["deepmuon.depth_m"] = text(depth);
    }

    // What the model says of itself at its depth, such as metadata("rate_hz_per_m2"); docs/onnx_contract.md lists the keys.
    const std::string& metadata(const std::string& key) const {
        const auto found = metadata_.find("deepmuon." + key);
        if (found == metadata_.end()) {
            throw std::runtime_error(model_ + " does not say its deepmuon." + key);
        }
        return found->second;
    }

    // The random numbers that deepmuon-gen takes for this model and a seed. To begin at another draw than the first,
    // leave out those before it: random.discard(draw * latent_size()).
    Philox random(std::uint64_t seed) const {
        const auto found = metadata_.find("deepmuon.flux");
        const std::string flux = found != metadata_.end() ? found->second : creator(metadata("created_by"));
        const std::string surface = metadata_.count("deepmuon.surface") ? metadata("surface") : "0";
        const float depth = static_cast<float>(number("depth_m"));
        return {seed, model_stream(metadata("architecture"), flux, metadata("medium"), surface, depth)};
    }

    std::size_t latent_size() const { return latent_size_; }

    // Muons from random bits: random() gives 32 of them, such as a Philox or a std::mt19937.
    template <class Random> std::vector<Muon> sample(std::size_t count, Random&& random) {
        std::vector<Muon> muons;
        muons.reserve(count);
        while (muons.size() < count) {
            const std::size_t missing = count - muons.size();
            const std::size_t draws = std::min((missing - 1) / muons_per_draw_ + 1, 1 + largest_run / muons_per_draw_);
            std::vector<float> latents(draws * latent_size_);
            std::generate(latents.begin(), latents.end(), [&] { return latent(static_cast<std::uint32_t>(random())); });
            const std::vector<Muon> made = run(latents);
            muons.insert(muons.end(), made.begin(), made.begin() + std::min(made.size(), missing));
        }
        return muons;
    }

    // The muons of given latents, draw by draw.
    std::vector<Muon> run(std::vector<float>& latents) { return engine_.run(latents, latents.size() / latent_size_); }

private:
    Generator(const std::string& model, const std::string& contents)
        : engine_(contents), model_(model), metadata_(engine_.metadata()) {
        if (metadata("contract_version") != "1" && metadata("contract_version") != "2") {
            throw std::runtime_error(model + " keeps version " + metadata("contract_version") +
                                     " of the contract, and this program reads versions 1 and 2");
        }
        latent_size_ = std::stoul(metadata("latent_size"));
        muons_per_draw_ = std::stoul(metadata("muons_per_draw"));
        if (metadata_.count("deepmuon.depth_min_m") && engine_.has_rate()) { // a family's rate goes with the depth
            std::vector<float> latents(latent_size_);
            metadata_["deepmuon.rate_hz_per_m2"] = text(engine_.rate(latents));
        }
    }

    double number(const std::string& key) const {
        double number = 0;
        std::istringstream text(metadata(key));
        text.imbue(std::locale::classic());
        text >> number;
        return number;
    }

    // The shortest text of a number.
    static std::string text(float number) {
        std::string text;
        for (int digits = 6; digits <= 9; ++digits) {
            std::ostringstream stream;
            stream.imbue(std::locale::classic());
            stream << std::setprecision(digits) << number;
            text = stream.str();
            std::istringstream back(text);
            back.imbue(std::locale::classic());
            double read = 0;
            back >> read;
            if (static_cast<float>(read) == number) {
                break;
            }
        }
        return text;
    }

    static constexpr std::size_t largest_run = 16384; // muons: what a processor's cache holds

    Engine engine_;
    std::string model_;
    std::map<std::string, std::string> metadata_;
    std::size_t latent_size_ = 0, muons_per_draw_ = 0;
};

} // namespace deepmuon
