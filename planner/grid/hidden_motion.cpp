// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/grid/hidden_motion.h"

#include <cmath>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// Random walk of everything but x and y, unit/sqrt(s).
double drift_of(const Motion& motion, Component component) {
  switch (component) {
    case Component::z:
      return motion.height_drift;
    case Component::yaw:
      return motion.yaw_drift;
    case Component::size:
      return motion.size_drift;
    default:
      return 0;
  }
}

int axis_of(Component component) {
  if (component == Component::x) return 0;
  return component == Component::y ? 1 : -1;
}

}  // namespace

HiddenMotion::HiddenMotion(const Scene& scene, const Motion& motion, double dwell_time)
    : unknowns_(scene.unknowns),
      objects_(object_count(scene)),
      presence_prior_(scene.presence_prior),
      motion_(motion),
      dwell_time_(dwell_time) {
  if (!(dwell_time > 0)) {
    throw Error("dwell_time = " + std::to_string(dwell_time) + "; accepted: seconds > 0");
  }
}

void HiddenMotion::move(const std::vector<PlanarVelocity>& velocities, double age,
                        PoseMode& mode) const {
  const double q = motion_.acceleration_density * age * age * age / 3;
  for (std::size_t i = 0; i < unknowns_.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const PlanarVelocity& velocity = velocities[static_cast<std::size_t>(unknowns_[i].object)];
    const int axis = axis_of(unknowns_[i].component);
    const double drift = drift_of(motion_, unknowns_[i].component);
    mode.covariance(row, row) += drift * drift * age + (axis >= 0 ? q : 0.0);
    if (axis < 0) continue;
    mode.pose[row] += age * velocity.mean[axis];
    for (std::size_t j = 0; j < unknowns_.size(); ++j) {
      const int other = axis_of(unknowns_[j].component);
      if (other < 0 || unknowns_[j].object != unknowns_[i].object) continue;
      mode.covariance(row, static_cast<Eigen::Index>(j)) +=
          age * age * velocity.covariance(axis, other);
    }
  }
}

PoseMixture HiddenMotion::predicted(const PoseMixture& mixture, double age,
                                    const std::vector<PlanarVelocity>& velocities) const {
  if (!(age >= 0) || !std::isfinite(age)) {
    throw Error("age = " + std::to_string(age) + "; accepted: seconds >= 0");
  }
  if (!velocities.empty() && velocities.size() != static_cast<std::size_t>(objects_)) {
    throw Error("velocities", std::to_string(velocities.size()) + " are given; accepted: " +
                                  std::to_string(objects_) + ", one for each hidden object");
  }
  const auto n = static_cast<Eigen::Index>(unknowns_.size());
  for (const PoseMode& mode : mixture.modes) {
    if (mode.pose.size() == n && mode.covariance.rows() == n && mode.covariance.cols() == n)
      continue;
    throw Error("pose mixture", "a mode has " + std::to_string(mode.pose.size()) +
                                    " values; accepted: " + std::to_string(n) +
                                    ", with a covariance of as many rows and columns");
  }
  PlanarVelocity any;
  any.covariance.diagonal().setConstant(motion_.initial_speed * motion_.initial_speed);
  const std::vector<PlanarVelocity> used =
      velocities.empty() ? std::vector<PlanarVelocity>(static_cast<std::size_t>(objects_), any)
                         : velocities;

  PoseMixture later = mixture;
  const double stays = std::exp(-age / dwell_time_);
  const double still_there = stays * mixture.presence_probability;
  later.presence_probability = still_there + (1 - stays) * presence_prior_;
  const double share =
      later.presence_probability > 0 ? still_there / later.presence_probability : 0;
  for (PoseMode& mode : later.modes) {
    mode.weight *= share;
    move(used, age, mode);
  }
  return later;
}

}  // namespace blindcorner
