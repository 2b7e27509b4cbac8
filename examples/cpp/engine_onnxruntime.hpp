#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <onnxruntime_cxx_api.h>

#include "muon.hpp"

namespace deepmuon {

// Runs a model in ONNX Runtime, in the thread that calls.
class Engine {
public:
    explicit Engine(const std::string& model)
        : session_(environment(), std::filesystem::path(model).c_str(), options()) {}

    std::map<std::string, std::string> metadata() const {
        Ort::AllocatorWithDefaultOptions allocator;
        const Ort::ModelMetadata found = session_.GetModelMetadata();
        std::map<std::string, std::string> metadata;
        for (const auto& key : found.GetCustomMetadataMapKeysAllocated(allocator)) {
            metadata[key.get()] = found.LookupCustomMetadataMapAllocated(key.get(), allocator).get();
        }
        return metadata;
    }

    std::vector<Muon> run(std::vector<float>& latent, std::size_t draws) {
        const std::array<const char*, 1> inputs{"latent"};
        const std::array<const char*, 3> outputs{"kinetic_energy", "direction", "charge"};
        const std::array<std::int64_t, 2> shape{static_cast<std::int64_t>(draws),
                                                static_cast<std::int64_t>(latent.size() / draws)};
        const auto memory = Ort::MemoryInfo::CreateCpu(OrtArenaAllocator, OrtMemTypeDefault);
        const auto input =
            Ort::Value::CreateTensor<float>(memory, latent.data(), latent.size(), shape.data(), shape.size());
        const auto found = session_.Run(Ort::RunOptions{nullptr}, inputs.data(), &input, 1, outputs.data(), 3);
        return muons(found[0].GetTensorTypeAndShapeInfo().GetElementCount(), found[0].GetTensorData<float>(),
                     found[1].GetTensorData<float>(), found[2].GetTensorData<std::int8_t>());
    }

private:
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
