// SPDX-License-Identifier: Apache-2.0
#include "simulation/network_perception.h"

#include <algorithm>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

constexpr const char* kPublished = "cnn";
constexpr const char* kWide = "cnn_wide";

std::shared_ptr<const CnnBaseline> network_of(const PerceptionSetup& setup,
                                              const std::string& name) {
  const auto network = setup.networks.find(name);
  if (network == setup.networks.end()) {
    throw Error("perception", name + " has no weights, accepted: a file of cnn train");
  }
  network->second->check_scene(setup.scene);
  return network->second;
}

class NetworkPerception final : public Perception {
 public:
  NetworkPerception(const PerceptionSetup& setup, const std::string& name)
      : scene_(setup.scene), network_(network_of(setup, name)) {}

  PerceptionAnswer perceive(const Capture& capture, const Transform& T_world_sensor,
                            double /*time*/) override {
    PerceptionAnswer answer;
    try {
      const PoseMixture said = network_->posterior(capture, T_world_sensor);
      answer.mixture = states_no_error() ? known_pose(scene_, said.mean) : said;
    } catch (const std::exception& error) {
      answer.error = error.what();
    }
    return answer;
  }

  std::optional<double> disc_radius() const override {
    return states_no_error() ? std::optional(kPublishedDisc) : std::nullopt;
  }

 private:
  /// Whether answers are taken for certain, as the published network's are.
  bool states_no_error() const { return perception_of(*network_) == kPublished; }

  const Scene& scene_;
  std::shared_ptr<const CnnBaseline> network_;
};

}  // namespace

std::unique_ptr<Perception> make_wide_cnn_perception(const PerceptionSetup& setup) {
  return std::make_unique<NetworkPerception>(setup, kWide);
}

std::unique_ptr<Perception> make_cnn_perception(const PerceptionSetup& setup) {
  return std::make_unique<NetworkPerception>(setup, kPublished);
}

std::vector<std::string> network_names() { return {kPublished, kWide}; }

bool is_network(const std::string& perception) {
  const std::vector<std::string> names = network_names();
  return std::ranges::find(names, perception) != names.end();
}

std::string perception_of(const CnnBaseline& network) {
  return network.description().network == CnnArchitecture::wide ? kWide : kPublished;
}

}  // namespace blindcorner
