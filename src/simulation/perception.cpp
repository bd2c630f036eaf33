// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/perception.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "io/json_reader.h"
#include "simulation/network_perception.h"
#include "simulation/solver_perception.h"

namespace blindcorner {
namespace {

class LineOfSightPerception final : public Perception {
 public:
  explicit LineOfSightPerception(bool expects_unseen) : expects_unseen_(expects_unseen) {}

  PerceptionAnswer perceive(const Capture& /*capture*/, const Transform& /*T_world_sensor*/,
                            double /*time*/) override {
    return {};
  }
  bool needs_histograms() const override { return false; }
  bool expects_unseen() const override { return expects_unseen_; }

 private:
  bool expects_unseen_;
};

class OraclePerception final : public Perception {
 public:
  explicit OraclePerception(const PerceptionSetup& setup)
      : scene_(setup.scene), truth_(setup.truth) {}

  PerceptionAnswer perceive(const Capture& /*capture*/, const Transform& /*T_world_sensor*/,
                            double time) override {
    PerceptionAnswer answer;
    const std::optional<PoseVector> pose = truth_(time);
    answer.mixture = known_pose(scene_, pose);
    if (pose) answer.velocities.push_back(velocity(time));
    return answer;
  }
  bool needs_histograms() const override { return false; }

 private:
  PoseVelocity velocity(double time) const {
    constexpr double kStep = 0.01;  // s
    const auto n = static_cast<Eigen::Index>(scene_.unknowns.size());
    PoseVelocity velocity{(*truth_(time + kStep) - *truth_(time)) / kStep,
                          Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(n, n)};
    for (Eigen::Index i = 0; i < n; ++i) {
      const Component component = scene_.unknowns[static_cast<std::size_t>(i)].component;
      const bool moves = component == Component::x || component == Component::y;
      if (!moves) velocity.mean[i] = 0;
      if (moves) velocity.covariance(i, i) = kKnownSpeed * kKnownSpeed;
    }
    return velocity;
  }

  const Scene& scene_;
  std::function<std::optional<PoseVector>(double)> truth_;
};

/// How a misled oracle states its position.
enum class StatedAs { disc, covariance };

/// The truth, moved by an injected error in one horizontal direction.
class MisledOracle final : public Perception {
 public:
  MisledOracle(const PerceptionSetup& setup, StatedAs stated)
      : scene_(setup.scene), truth_(setup.truth), error_(setup.injected_error), stated_(stated) {
    std::mt19937_64 random(setup.seed ^ kDirectionSeed);
    const double angle = std::uniform_real_distribution<double>(0, 2 * kPi)(random);
    offset_ = {error_ * std::cos(angle), error_ * std::sin(angle)};
  }

  PerceptionAnswer perceive(const Capture& /*capture*/, const Transform& /*T_world_sensor*/,
                            double time) override {
    std::optional<PoseVector> pose = truth_(time);
    if (pose) move(*pose);
    PerceptionAnswer answer;
    answer.mixture = known_pose(scene_, pose);
    if (stated_ == StatedAs::covariance) widen(*answer.mixture);
    return answer;
  }
  bool needs_histograms() const override { return false; }
  std::optional<double> disc_radius() const override {
    return stated_ == StatedAs::disc ? std::optional(kPublishedDisc) : std::nullopt;
  }

 private:
  /// Directions come from another random sequence than the world's random values.
  static constexpr std::uint64_t kDirectionSeed = 0xd1b54a32d192ed03;

  /// The axis of an unknown that is a horizontal position: 0 for x, 1 for y. Empty for others.
  static std::optional<int> axis(const Unknown& unknown) {
    const int component = static_cast<int>(unknown.component);
    return component <= 1 ? std::optional(component) : std::nullopt;
  }
  void move(PoseVector& pose) const {
    for (std::size_t i = 0; i < scene_.unknowns.size(); ++i) {
      if (const auto a = axis(scene_.unknowns[i]))
        pose[static_cast<Eigen::Index>(i)] += offset_[*a];
    }
  }
  /// The root of the mean squared distance from the stated position is the injected error.
  void widen(PoseMixture& mixture) const {
    for (std::size_t i = 0; i < scene_.unknowns.size(); ++i) {
      if (!axis(scene_.unknowns[i])) continue;
      const auto k = static_cast<Eigen::Index>(i);
      mixture.covariance(k, k) += error_ * error_ / 2;
      for (PoseMode& mode : mixture.modes) mode.covariance(k, k) += error_ * error_ / 2;
    }
  }

  const Scene& scene_;
  std::function<std::optional<PoseVector>(double)> truth_;
  double error_;
  StatedAs stated_;
  Eigen::Vector2d offset_ = Eigen::Vector2d::Zero();
};

struct Entry {
  const char* name;
  std::unique_ptr<Perception> (*make)(const PerceptionSetup&);
  double delay = 0;  ///< s, where the drive file declares none
};

/// Upper estimates of the networks' delays, s. A frame of street_turn, 64 zones of 256 bins, took
/// 0.15 ms (90 % within 0.17) for cnn and 2.7 ms (3.5) for cnn_wide on one of two shared cores,
/// medians of 4064 frames by `cnn evaluate`. Frames of 9 zones and 128 bins take 0.05 ms, and less
/// than 6 on a busy core.
constexpr double kCnnDelay = 0.001;
constexpr double kWideCnnDelay = 0.01;

constexpr std::array kPerceptions = {
    Entry{"los",
          [](const PerceptionSetup& /*setup*/) -> std::unique_ptr<Perception> {
            return std::make_unique<LineOfSightPerception>(false);
          }},
    Entry{"los_cautious",
          [](const PerceptionSetup& /*setup*/) -> std::unique_ptr<Perception> {
            return std::make_unique<LineOfSightPerception>(true);
          }},
    Entry{"solver", make_solver_perception},
    Entry{"cnn", make_cnn_perception, kCnnDelay},
    Entry{"cnn_wide", make_wide_cnn_perception, kWideCnnDelay},
    Entry{"oracle",
          [](const PerceptionSetup& setup) -> std::unique_ptr<Perception> {
            return std::make_unique<OraclePerception>(setup);
          }},
    Entry{"oracle_disc",
          [](const PerceptionSetup& setup) -> std::unique_ptr<Perception> {
            return std::make_unique<MisledOracle>(setup, StatedAs::disc);
          }},
    Entry{"oracle_covariance", [](const PerceptionSetup& setup) -> std::unique_ptr<Perception> {
            return std::make_unique<MisledOracle>(setup, StatedAs::covariance);
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

void check_perception(const std::string& name, const std::string& field,
                      const std::vector<std::string>& accepted) {
  if (std::ranges::find(accepted, name) != accepted.end()) return;
  throw Error(field, "found \"" + name + "\", accepted: " + list_words(accepted));
}

double default_delay(const std::string& name) {
  const auto entry =
      std::ranges::find_if(kPerceptions, [&](const Entry& e) { return name == e.name; });
  return entry == kPerceptions.end() ? 0.0 : entry->delay;
}

double declared_delay(const Drive& drive, const std::string& name) {
  const auto declared = drive.delay.find(name);
  return declared == drive.delay.end() ? default_delay(name) : declared->second;
}

std::unique_ptr<Perception> make_perception(const std::string& name, const PerceptionSetup& setup) {
  check_perception(name, "perception");
  return std::ranges::find_if(kPerceptions, [&](const Entry& e) { return name == e.name; })
      ->make(setup);
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
