#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <openvino/openvino.hpp>

#include "muon.hpp"

namespace deepmuon {

// Runs a model in OpenVINO on the CPU, in one thread.
class Engine {
public:
    // Takes the contents of an ONNX file.
    explicit Engine(const std::string& contents) : model_(core().read_model(contents, ov::Tensor())) {
        // float32 even where the processor has units for less: OpenVINO would take those.
        request_ = core()
                       .compile_model(model_, "CPU", ov::hint::inference_precision(ov::element::f32),
                                      ov::inference_num_threads(1))
                       .create_infer_request();
    }

    // What ONNX calls metadata_props, OpenVINO keeps as runtime information under "framework".
    std::map<std::string, std::string> metadata() const {
        std::map<std::string, std::string> metadata;
        if (model_->has_rt_info("framework")) {
            for (const auto& [key, value] : model_->get_rt_info<ov::AnyMap>("framework")) {
                metadata[key] = value.as<std::string>();
            }
        }
        return metadata;
    }

    bool has_rate() const {
        const auto outputs = model_->outputs();
        return std::any_of(outputs.begin(), outputs.end(),
                           [](const auto& output) { return output.get_names().count("rate_hz_per_m2") > 0; });
    }

    // Muons per second and m2, whatever the latents, which are those of one draw.
    float rate(std::vector<float>& latent) {
        run(latent, 1);
        return *request_.get_tensor("rate_hz_per_m2").data<float>();
    }

    std::vector<Muon> run(std::vector<float>& latent, std::size_t draws) {
        request_.set_tensor("latent", ov::Tensor(ov::element::f32, {draws, latent.size() / draws}, latent.data()));
        request_.infer();
        const auto energy = request_.get_tensor("kinetic_energy");
        return muons(energy.get_size(), energy.data<float>(), request_.get_tensor("direction").data<float>(),
                     request_.get_tensor("charge").data<std::int8_t>());
    }

private:
    static ov::Core& core() {
        static ov::Core core;
        return core;
    }

    std::shared_ptr<ov::Model> model_;
    ov::InferRequest request_;
};

} // namespace deepmuon
