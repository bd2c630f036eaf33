// SPDX-License-Identifier: Apache-2.0
#include "simulation/sightings.h"

#include <algorithm>

#include "blindcorner/planner/grid/occupancy_grid.h"
#include "inverse/posterior/posterior.h"
#include "planner/grid/object_marginal.h"

namespace blindcorner {

Sightings::Sightings(const Scene& scene, const Motion& motion)
    : scene_(scene),
      acceleration_density_(motion.acceleration_density),
      initial_speed_(motion.initial_speed),
      motion_(scene, motion, OccupancyOptions{}.dwell_time),
      seen_(static_cast<std::size_t>(object_count(scene))) {}

/// Position of an object; 0 along an axis that is known.
Eigen::Vector2d Sightings::position_of(std::size_t object, const PoseVector& pose) const {
  Eigen::Vector2d position = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < scene_.unknowns.size(); ++i) {
    const auto axis = static_cast<Eigen::Index>(scene_.unknowns[i].component);
    if (static_cast<std::size_t>(scene_.unknowns[i].object) != object || axis > 1) continue;
    position[axis] = pose[static_cast<Eigen::Index>(i)];
  }
  return position;
}

Sightings::Sighting Sightings::moved(const Sighting& sighting, double time) const {
  Sighting later = sighting;
  const double t = std::max(0.0, time - sighting.time), q = acceleration_density_;
  Eigen::Matrix2d step, walk;
  step << 1, t, 0, 1;
  walk << t * t * t / 3, t * t / 2, t * t / 2, t;
  later.time = std::max(time, sighting.time);
  later.position += t * sighting.velocity;
  later.covariance = step * sighting.covariance * step.transpose() + q * walk;
  return later;
}

/// Begins the track of an object that is seen for the first time. Its velocity is that of the
/// perceived mode that weighs more than half. If there is none, it may be any.
Sightings::Sighting Sightings::begun(std::size_t object, const PoseVector& pose,
                                     const PerceptionAnswer& perceived) const {
  Sighting track;
  track.position = position_of(object, pose);
  double variance = initial_speed_ * initial_speed_;
  if (perceived.mixture && perceived.velocities.size() == perceived.mixture->modes.size()) {
    for (std::size_t m = 0; m < perceived.velocities.size(); ++m) {
      if (perceived.mixture->modes[m].weight <= 0.5) continue;
      const PoseVelocity& velocity = perceived.velocities[m];
      track.velocity = position_of(object, velocity.mean);
      variance = std::min(variance, position_of(object, velocity.covariance.diagonal()).maxCoeff());
    }
  }
  track.covariance << kKnownPosition * kKnownPosition, 0, 0,
      std::max(variance, kKnownSpeed * kKnownSpeed);
  return track;
}

void Sightings::see(const std::vector<bool>& in_sight, const PoseVector& pose, double time,
                    const PerceptionAnswer& perceived) {
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    const bool late = seen_[i] && seen_[i]->time > time;
    if (!in_sight[i] || late) continue;
    Sighting track = begun(i, pose, perceived);
    if (seen_[i]) {
      track = moved(*seen_[i], time);
      const double total = track.covariance(0, 0) + kKnownPosition * kKnownPosition;
      const Eigen::Vector2d gain = track.covariance.col(0) / total;
      const Eigen::Vector2d off = position_of(i, pose) - track.position;
      track.position += gain[0] * off;
      track.velocity += gain[1] * off;
      track.covariance -= gain * track.covariance.row(0).eval();
    }
    track.pose = pose;
    track.time = time;
    seen_[i] = track;
  }
}

bool Sightings::any() const {
  return std::ranges::any_of(seen_, [](const auto& sighting) { return sighting.has_value(); });
}

/// The perception's modes, moved on. If there are none, one mode that knows nothing.
PerceptionAnswer Sightings::elsewhere(const PerceptionAnswer& perceived, double age) const {
  PerceptionAnswer answer;
  answer.mixture.emplace();
  if (perceived.mixture && !perceived.mixture->modes.empty()) {
    answer.mixture = motion_.predicted(*perceived.mixture, age, perceived.velocities);
    answer.velocities = perceived.velocities;
    for (PoseVelocity& velocity : answer.velocities) {
      velocity.with_pose += age * velocity.covariance;
    }
    // All objects are there, because one was seen: the modes share all weight, and none is left for
    // objects that may have gone.
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

/// Puts an object that has been seen where its track says.
void Sightings::pin(std::size_t object, double time, PoseMode& mode, PoseVelocity& velocity) const {
  const Sighting& sighting = *seen_[object];
  const Sighting track = moved(sighting, time);
  const PoseMode now =
      motion_.predicted(known_pose(scene_, sighting.pose), std::max(0.0, time - sighting.time))
          .modes.front();
  for (std::size_t i = 0; i < scene_.unknowns.size(); ++i) {
    if (static_cast<std::size_t>(scene_.unknowns[i].object) != object) continue;
    const auto row = static_cast<Eigen::Index>(i);
    const auto axis = static_cast<Eigen::Index>(scene_.unknowns[i].component);
    const bool moves = axis <= 1;
    mode.pose[row] = mode.optimum[row] = moves ? track.position[axis] : now.pose[row];
    for (Eigen::MatrixXd* matrix : {&mode.covariance, &velocity.covariance, &velocity.with_pose}) {
      matrix->row(row).setZero();
      matrix->col(row).setZero();
    }
    mode.covariance(row, row) = moves ? track.covariance(0, 0) : now.covariance(row, row);
    velocity.mean[row] = moves ? track.velocity[axis] : 0.0;
    velocity.covariance(row, row) = moves ? track.covariance(1, 1) : 0.0;
    velocity.with_pose(row, row) = moves ? track.covariance(0, 1) : 0.0;
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
    // All objects are pinned, so that the modes differ in nothing.
    answer.mixture->modes.resize(1);
    answer.mixture->modes.front().weight = 1;
    answer.velocities.resize(1);
  }
  answer.flags = {all ? "in_sight" : "partly_in_sight"};
  set_moments(scene_, *answer.mixture);
  return answer;
}

}  // namespace blindcorner
