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

bool moves(Component component) { return component == Component::x || component == Component::y; }

void check_size(const std::string& what, Eigen::Index found, Eigen::Index n) {
  if (found == n) return;
  throw Error("pose mixture", what + " has " + std::to_string(found) +
                                  " values; accepted: " + std::to_string(n) +
                                  ", with covariances of as many rows and columns");
}

/// n, or -1 for a matrix that is not square.
Eigen::Index side(const Eigen::MatrixXd& m) { return m.rows() == m.cols() ? m.rows() : -1; }

}  // namespace

HiddenMotion::HiddenMotion(const Scene& scene, const Motion& motion, double dwell_time)
    : unknowns_(scene.unknowns),
      presence_prior_(scene.presence_prior),
      motion_(motion),
      dwell_time_(dwell_time) {
  if (!(dwell_time > 0)) {
    throw Error("dwell_time = " + std::to_string(dwell_time) + "; accepted: seconds > 0");
  }
}

PoseVelocity HiddenMotion::any_velocity() const {
  const auto n = static_cast<Eigen::Index>(unknowns_.size());
  PoseVelocity any{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n),
                   Eigen::MatrixXd::Zero(n, n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    if (!moves(unknowns_[static_cast<std::size_t>(i)].component)) continue;
    any.covariance(i, i) = motion_.initial_speed * motion_.initial_speed;
  }
  return any;
}

void HiddenMotion::move(const PoseVelocity& velocity, double age, PoseMode& mode) const {
  mode.pose += age * velocity.mean;
  mode.covariance +=
      age * (velocity.with_pose + velocity.with_pose.transpose()) + age * age * velocity.covariance;
  const double q = motion_.acceleration_density * age * age * age / 3;
  for (std::size_t i = 0; i < unknowns_.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const double drift = drift_of(motion_, unknowns_[i].component);
    mode.covariance(row, row) += moves(unknowns_[i].component) ? q : drift * drift * age;
  }
}

PoseMixture HiddenMotion::predicted(const PoseMixture& mixture, double age,
                                    const std::vector<PoseVelocity>& velocities) const {
  if (!(age >= 0) || !std::isfinite(age)) {
    throw Error("age = " + std::to_string(age) + "; accepted: seconds >= 0");
  }
  if (!velocities.empty() && velocities.size() != mixture.modes.size()) {
    throw Error("velocities", std::to_string(velocities.size()) + " are given; accepted: " +
                                  std::to_string(mixture.modes.size()) + ", one for each mode");
  }
  const auto n = static_cast<Eigen::Index>(unknowns_.size());
  for (const PoseMode& mode : mixture.modes) {
    check_size("a mode", mode.pose.size(), n);
    check_size("a mode's covariance", side(mode.covariance), n);
  }
  for (const PoseVelocity& velocity : velocities) {
    check_size("a velocity", velocity.mean.size(), n);
    check_size("a velocity's covariance", side(velocity.covariance), n);
    check_size("a velocity's covariance with the pose", side(velocity.with_pose), n);
  }
  const PoseVelocity any = any_velocity();

  PoseMixture later = mixture;
  const double stays = std::exp(-age / dwell_time_);
  const double still_there = stays * mixture.presence_probability;
  later.presence_probability = still_there + (1 - stays) * presence_prior_;
  const double share =
      later.presence_probability > 0 ? still_there / later.presence_probability : 0;
  for (std::size_t i = 0; i < later.modes.size(); ++i) {
    later.modes[i].weight *= share;
    move(velocities.empty() ? any : velocities[i], age, later.modes[i]);
  }
  return later;
}

}  // namespace blindcorner
