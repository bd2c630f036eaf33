// SPDX-License-Identifier: Apache-2.0
#include "simulation/sightings.h"

#include <algorithm>

#include "blindcorner/planner/grid/occupancy_grid.h"
#include "inverse/posterior/posterior.h"
#include "inverse/posterior/prior_moments.h"

namespace blindcorner {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// A mode that knows no more than the scene's prior.
PoseMode anywhere(const Scene& scene) {
  const auto n = static_cast<Index>(scene.unknowns.size());
  PoseMode mode;
  mode.weight = 1;
  mode.pose.resize(n);
  mode.covariance = MatrixXd::Zero(n, n);
  for (Index i = 0; i < n; ++i) {
    const PriorMoments prior = prior_moments(scene, static_cast<std::size_t>(i));
    mode.pose[i] = prior.mean;
    mode.covariance(i, i) = prior.variance;
    mode.undetermined.push_back(static_cast<int>(i));
  }
  mode.optimum = mode.pose;
  return mode;
}

}  // namespace

Sightings::Sightings(const Scene& scene, const Motion& motion)
    : scene_(scene),
      motion_(scene, motion, OccupancyOptions{}.dwell_time),
      seen_(static_cast<std::size_t>(object_count(scene))) {}

void Sightings::see(const std::vector<bool>& in_sight, const PoseVector& pose, double time) {
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    const bool late = seen_[i] && seen_[i]->time > time;
    if (in_sight[i] && !late) seen_[i] = Sighting{pose, time};
  }
}

bool Sightings::any() const {
  return std::ranges::any_of(seen_, [](const auto& sighting) { return sighting.has_value(); });
}

/// Perception's modes, moved on, or one that knows nothing.
PerceptionAnswer Sightings::elsewhere(const PerceptionAnswer& perceived, double age) const {
  PerceptionAnswer answer;
  answer.mixture.emplace();
  if (perceived.mixture && !perceived.mixture->modes.empty()) {
    answer.mixture = motion_.predicted(*perceived.mixture, age, perceived.velocities);
    answer.velocities = perceived.velocities;
    for (PoseVelocity& velocity : answer.velocities) {
      velocity.with_pose += age * velocity.covariance;
    }
    // All objects are there, as the one that was seen: what may have left is none of them.
    double total = 0;
    for (const PoseMode& mode : answer.mixture->modes) total += mode.weight;
    for (PoseMode& mode : answer.mixture->modes) mode.weight /= total;
  } else {
    answer.mixture->modes.push_back(anywhere(scene_));
  }
  answer.mixture->presence_probability = 1;
  answer.velocities.resize(answer.mixture->modes.size(), motion_.any_velocity());
  return answer;
}

/// Puts objects that have been seen where they were.
void Sightings::pin(double time, PoseMode& mode, PoseVelocity& velocity) const {
  const PoseVelocity any = motion_.any_velocity();
  for (std::size_t i = 0; i < scene_.unknowns.size(); ++i) {
    const auto& sighting = seen_[static_cast<std::size_t>(scene_.unknowns[i].object)];
    if (!sighting) continue;
    const auto row = static_cast<Index>(i);
    const PoseMixture then = known_pose(scene_, sighting->pose);
    const PoseMode now =
        motion_.predicted(then, std::max(0.0, time - sighting->time)).modes.front();
    mode.pose[row] = mode.optimum[row] = now.pose[row];
    for (MatrixXd* matrix : {&mode.covariance, &velocity.covariance, &velocity.with_pose}) {
      matrix->row(row).setZero();
      matrix->col(row).setZero();
    }
    mode.covariance(row, row) = now.covariance(row, row);
    velocity.mean[row] = 0;
    velocity.covariance(row, row) = any.covariance(row, row);
    std::erase(mode.undetermined, static_cast<int>(i));
  }
}

PerceptionAnswer Sightings::answer(const PerceptionAnswer& perceived, double age,
                                   double time) const {
  PerceptionAnswer answer = elsewhere(perceived, age);
  for (std::size_t i = 0; i < answer.mixture->modes.size(); ++i) {
    pin(time, answer.mixture->modes[i], answer.velocities[i]);
  }
  const bool all =
      std::ranges::all_of(seen_, [](const auto& sighting) { return sighting.has_value(); });
  if (all) {
    // Modes differ in nothing any more.
    answer.mixture->modes.resize(1);
    answer.mixture->modes.front().weight = 1;
    answer.velocities.resize(1);
  }
  answer.flags = {all ? "in_sight" : "partly_in_sight"};
  set_moments(scene_, *answer.mixture);
  return answer;
}

}  // namespace blindcorner
