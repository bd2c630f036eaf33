// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/traffic.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "blindcorner/forward/error.h"
#include "planner/grid/spread_points.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

/// Number of samples of a mover. A risk of 0.02 is then two or three of them.
constexpr int kSamples = 128;
/// Time between places that are compared, s: a metre at 20 m/s, less than half of any body.
constexpr double kStep = 0.05;
/// Decelerations that are tried, in shares of the friction limit.
constexpr std::array kBraking{0.1, 0.2, 0.275, 0.35, 0.45, 0.55, 0.7, 0.85, 1.0};
/// Ratio of spread_point() in six dimensions: x^7 = x + 1.
constexpr double kRatio = 1.1127756842787055;

/// A position and a velocity of a mover, and the displacement by the random walk of its velocity,
/// per s^1.5.
struct Sample {
  Vector2d position, velocity, gained;
};

std::vector<Sample> samples_of(const Mover& mover) {
  const Eigen::LDLT<Eigen::Matrix4d> factor(mover.covariance);
  const Eigen::Matrix4d root = factor.matrixL();
  const Eigen::Vector4d scale = factor.vectorD().cwiseMax(0).cwiseSqrt();
  std::vector<Sample> samples;
  for (int i = 0; i < kSamples; ++i) {
    const std::array<double, 6> u = spread_point<6>(i, kRatio);
    Eigen::Vector4d normal;
    normal << normal_point(u[0], u[1]), normal_point(u[2], u[3]);
    const Eigen::Vector4d off =
        factor.transpositionsP().transpose() * (root * scale.cwiseProduct(normal));
    samples.push_back({mover.pose.position + off.head<2>(), mover.velocity + off.tail<2>(),
                       std::sqrt(mover.acceleration_density / 3) * normal_point(u[4], u[5])});
  }
  return samples;
}

/// A vehicle's places and speeds at times 0, kStep, 2 kStep, ...
struct Course {
  std::vector<PlanarPose> poses;
  std::vector<double> speeds;  ///< m/s
};

class Traffic {
 public:
  Traffic(const PathFollower& follower, const VehicleState& state, const VehicleFootprint& body,
          double friction, std::span<const Mover> movers, const TrafficOptions& options)
      : follower_(follower),
        state_(state),
        body_(body),
        friction_(friction),
        movers_(movers),
        options_(options) {
    for (const Mover& mover : movers) samples_.push_back(samples_of(mover));
    const std::vector<PathPoint>& path = follower.path();
    here_ =
        nearest_arc_length(path, state.position, path.front().arc_length, path.back().arc_length);
  }

  /// The result of a course.
  struct Outcome {
    double probability = 0, time = 0;  ///< of touching a mover; mean time, s, times it
    double damage = 0;                 ///< m^2/s^2, expected square of the speed of impact
    double exposure = 0;               ///< m^2/s, integral of that square over the time in touch
    std::vector<double> of_mover;      ///< [movers] probability
  };

  /// `braking`: share of the friction limit; 0: as the follower's profile says.
  Outcome of(double braking) const { return meetings(course(braking), options_.margin); }
  /// Damage and exposure of a touch itself, not of coming nearer than the margin. The exposure
  /// decides between courses that begin with a touch (bodies are discs, which bulge).
  std::pair<double, double> damage(double braking) const {
    const Outcome outcome = meetings(course(braking), 0);
    return {outcome.damage, outcome.exposure};
  }

 private:
  PlanarPose pose_at(double arc_length) const;
  Course course(double braking) const;
  Outcome meetings(const Course& course, double margin) const;

  const PathFollower& follower_;
  const VehicleState& state_;
  const VehicleFootprint& body_;
  double friction_;
  std::span<const Mover> movers_;
  const TrafficOptions& options_;
  std::vector<std::vector<Sample>> samples_;
  double here_ = 0;  ///< m
};

/// Beyond its end a path goes straight on.
PlanarPose Traffic::pose_at(double arc_length) const {
  const std::vector<PathPoint>& path = follower_.path();
  const PathPoint place = path_at(path, arc_length);
  const double beyond = std::max(0.0, arc_length - path.back().arc_length);
  PlanarPose pose = body_on_path(body_, place);
  pose.position += beyond * Vector2d(std::cos(place.heading), std::sin(place.heading));
  return pose;
}

Course Traffic::course(double braking) const {
  Course course;
  double s = here_, v = std::max(0.0, state_.speed);
  for (double t = 0; t <= options_.horizon; t += kStep) {
    course.poses.push_back(pose_at(s));
    course.speeds.push_back(v);
    const double before = v;
    if (braking > 0) {
      if (t >= options_.reaction_time) v = std::max(0.0, v - braking * friction_ * kStep);
    } else {
      v = std::max(0.0, v + follower_.acceleration_at(s, v) * kStep);
    }
    s += 0.5 * (before + v) * kStep;
  }
  return course;
}

Traffic::Outcome Traffic::meetings(const Course& course, double margin) const {
  Outcome outcome;
  for (std::size_t m = 0; m < movers_.size(); ++m) {
    const Mover& mover = movers_[m];
    const double weight = mover.probability / kSamples;
    double probability = 0;
    for (const Sample& sample : samples_[m]) {
      bool met = false;
      for (std::size_t k = 0; k < course.poses.size(); ++k) {
        const double t = kStep * static_cast<double>(k);
        const Vector2d at =
            sample.position + t * sample.velocity + std::pow(t, 1.5) * sample.gained;
        if (!touch(body_, course.poses[k], mover.body, {at, mover.pose.heading}, margin)) {
          continue;
        }
        const double squared = course.speeds[k] * course.speeds[k];
        outcome.exposure += weight * squared * kStep;
        if (std::exchange(met, true)) continue;
        probability += weight;
        outcome.time += weight * t;
        outcome.damage += weight * squared;
      }
    }
    outcome.of_mover.push_back(probability);
    outcome.probability += probability;
  }
  return outcome;
}

}  // namespace

void TrafficOptions::validate() const {
  const auto require = [](const char* field, double value, bool good, const char* accepted) {
    if (good) return;
    throw Error("TrafficOptions." + std::string(field) + " = " + std::to_string(value) +
                "; accepted: " + accepted);
  };
  require("risk", risk, risk >= 0 && risk <= 1, "a probability");
  require("comfortable", comfortable, comfortable > 0 && comfortable <= 1,
          "a share above 0, at most 1");
  require("reaction_time", reaction_time, reaction_time >= 0 && std::isfinite(reaction_time),
          "seconds >= 0");
  require("horizon", horizon, horizon > 0 && std::isfinite(horizon), "seconds > 0");
  require("margin", margin, margin >= 0 && std::isfinite(margin), "metres >= 0");
}

TrafficDecision decide_for_traffic(const PathFollower& follower, const VehicleState& state,
                                   const VehicleFootprint& body, double friction,
                                   std::span<const Mover> movers, const TrafficOptions& options) {
  options.validate();
  TrafficDecision decision;
  if (movers.empty()) return decision;
  const Traffic traffic(follower, state, body, friction, movers, options);
  const Traffic::Outcome on = traffic.of(0);
  if (on.probability <= 0) return decision;
  const auto likeliest = std::ranges::max_element(on.of_mover) - on.of_mover.begin();
  decision.mover = movers[static_cast<std::size_t>(likeliest)].name;
  decision.probability = on.probability;
  decision.time = on.time / on.probability;
  if (on.probability <= options.risk) return decision;
  for (const double braking : kBraking) {
    if (traffic.of(braking).probability > options.risk) continue;
    decision.braking = braking >= options.comfortable ? braking : 0.0;
    return decision;
  }
  // The margin cannot be kept, so that the damage of touching decides.
  std::pair<double, double> least = traffic.damage(0);
  for (const double braking : kBraking) {
    const std::pair<double, double> damage = traffic.damage(braking);
    if (damage >= least) continue;
    least = damage;
    decision.braking = braking;
  }
  return decision;
}

}  // namespace blindcorner
