// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/perception.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "blindcorner/forward/error.h"
#include "simulation/solver_perception.h"

namespace blindcorner {
namespace {

class LineOfSightPerception final : public Perception {
 public:
  PerceptionAnswer perceive(const Capture& /*capture*/, const Transform& /*T_world_sensor*/,
                            double /*time*/) override {
    return {};
  }
  bool needs_capture() const override { return false; }
};

class OraclePerception final : public Perception {
 public:
  explicit OraclePerception(const PerceptionSetup& setup)
      : scene_(setup.scene), truth_(setup.truth) {}

  PerceptionAnswer perceive(const Capture& /*capture*/, const Transform& /*T_world_sensor*/,
                            double time) override {
    PerceptionAnswer answer;
    answer.mixture = known_pose(scene_, truth_(time));
    return answer;
  }
  bool needs_capture() const override { return false; }

 private:
  const Scene& scene_;
  std::function<std::optional<PoseVector>(double)> truth_;
};

struct Entry {
  const char* name;
  std::unique_ptr<Perception> (*make)(const PerceptionSetup&);
};

constexpr std::array kPerceptions = {
    Entry{"los",
          [](const PerceptionSetup& /*setup*/) -> std::unique_ptr<Perception> {
            return std::make_unique<LineOfSightPerception>();
          }},
    Entry{"solver", make_solver_perception},
    Entry{"oracle", [](const PerceptionSetup& setup) -> std::unique_ptr<Perception> {
            return std::make_unique<OraclePerception>(setup);
          }}};

double known_sigma(Component component) {
  return component == Component::yaw    ? kKnownAngle
         : component == Component::size ? kKnownSize
                                        : kKnownPosition;
}

}  // namespace

std::vector<std::string> perception_names() {
  std::vector<std::string> names;
  for (const Entry& entry : kPerceptions) names.emplace_back(entry.name);
  return names;
}

std::unique_ptr<Perception> make_perception(const std::string& name, const PerceptionSetup& setup) {
  const auto* entry =
      std::ranges::find_if(kPerceptions, [&](const Entry& e) { return name == e.name; });
  if (entry != kPerceptions.end()) return entry->make(setup);
  std::string accepted;
  for (const std::string& known : perception_names()) {
    accepted += (accepted.empty() ? "\"" : ", \"") + known + "\"";
  }
  throw Error("perception", "found \"" + name + "\", accepted: " + accepted);
}

PoseMixture known_pose(const Scene& scene, const std::optional<PoseVector>& pose) {
  PoseMixture mixture;
  const auto count = static_cast<Eigen::Index>(scene.unknowns.size());
  mixture.covariance = Eigen::MatrixXd::Zero(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double sigma = known_sigma(scene.unknowns[static_cast<std::size_t>(i)].component);
    mixture.covariance(i, i) = sigma * sigma;
  }
  if (!pose) return mixture;
  mixture.presence_probability = 1;
  mixture.mean = *pose;
  PoseMode mode;
  mode.weight = 1;
  mode.pose = mode.optimum = *pose;
  mode.covariance = mixture.covariance;
  mixture.modes.push_back(std::move(mode));
  return mixture;
}

}  // namespace blindcorner
