// SPDX-License-Identifier: Apache-2.0
#include "simulation/sightings.h"

#include <algorithm>

#include "blindcorner/planner/grid/occupancy_grid.h"
#include "inverse/posterior/posterior.h"
#include "planner/grid/object_marginal.h"

namespace blindcorner {

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
    answer.mixture->modes.push_back(prior_mode(scene_.unknowns, 1));
    answer.mixture->modes.front().optimum = answer.mixture->modes.front().pose;
  }
  answer.mixture->presence_probability = 1;
  answer.velocities.resize(answer.mixture->modes.size(), motion_.any_velocity());
  return answer;
}

/// Puts an object that has been seen where it was.
void Sightings::pin(std::size_t object, double time, PoseMode& mode, PoseVelocity& velocity) const {
  const Sighting& sighting = *seen_[object];
  const PoseVelocity any = motion_.any_velocity();
  const PoseMode now =
      motion_.predicted(known_pose(scene_, sighting.pose), std::max(0.0, time - sighting.time))
          .modes.front();
  for (std::size_t i = 0; i < scene_.unknowns.size(); ++i) {
    if (static_cast<std::size_t>(scene_.unknowns[i].object) != object) continue;
    const auto row = static_cast<Eigen::Index>(i);
    mode.pose[row] = mode.optimum[row] = now.pose[row];
    for (Eigen::MatrixXd* matrix : {&mode.covariance, &velocity.covariance, &velocity.with_pose}) {
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
  for (std::size_t object = 0; object < seen_.size(); ++object) {
    if (!seen_[object]) continue;
    for (std::size_t i = 0; i < answer.mixture->modes.size(); ++i) {
      pin(object, time, answer.mixture->modes[i], answer.velocities[i]);
    }
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
