#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include <onnxruntime_cxx_api.h>

#include "muon.hpp"

namespace deepmuon {

// Runs a model in ONNX Runtime, in the thread that calls.
class Engine {
public:
    // Takes the contents of an ONNX file.
    explicit Engine(const std::string& contents)
        : session_(environment(), contents.data(), contents.size(), options()) {}

    std::map<std::string, std::string> metadata() const {
        Ort::AllocatorWithDefaultOptions allocator;
        const Ort::ModelMetadata found = session_.GetModelMetadata();
        std::map<std::string, std::string> metadata;
        for (const auto& key : found.GetCustomMetadataMapKeysAllocated(allocator)) {
            metadata[key.get()] = found.LookupCustomMetadataMapAllocated(key.get(), allocator).get();
        }
        return metadata;
    }

    bool has_rate() const {
        Ort::AllocatorWithDefaultOptions allocator;
        for (std::size_t i = 0; i < session_.GetOutputCount(); ++i) {
            if (std::string(session_.GetOutputNameAllocated(i, allocator).get()) == "rate_hz_per_m2") {
                return true;
            }
        }
        return false;
    }

    // Muons per second and m2, whatever the latents, which are those of one draw.
    float rate(std::vector<float>& latent) {
        return *outputs(latent, 1, std::array<const char*, 1>{"rate_hz_per_m2"})[0].GetTensorData<float>();
    }

    std::vector<Muon> run(std::vector<float>& latent, std::size_t draws) {
        const auto found = outputs(latent, draws, std::array<const char*, 3>{"kinetic_energy", "direction", "charge"});
        return muons(found[0].GetTensorTypeAndShapeInfo().GetElementCount(), found[0].GetTensorData<float>(),
                     found[1].GetTensorData<float>(), found[2].GetTensorData<std::int8_t>());
    }

private:
    template <std::size_t Count>
    std::vector<Ort::Value> outputs(std::vector<float>& latent, std::size_t draws,
                                    const std::array<const char*, Count>& names) {
        const std::array<const char*, 1> inputs{"latent"};
        const std::array<std::int64_t, 2> shape{static_cast<std::int64_t>(draws),
                                                static_cast<std::int64_t>(latent.size() / draws)};
        const auto memory = Ort::MemoryInfo::CreateCpu(OrtArenaAllocator, OrtMemTypeDefault);
        const auto input =
            Ort::Value::CreateTensor<float>(memory, latent.data(), latent.size(), shape.data(), shape.size());
        return session_.Run(Ort::RunOptions{nullptr}, inputs.data(), &input, 1, names.data(), names.size());
    }

    static Ort::Env& environment() {
        static Ort::Env environment(ORT_LOGGING_LEVEL_ERROR, "deepmuon");
        return environment;
    }

    static Ort::SessionOptions options() {
        Ort::SessionOptions options;
        options.SetIntraOpNumThreads(1);
        return options;
    }

    Ort::Session session_;
};

} // namespace deepmuon
