// SPDX-License-Identifier: Apache-2.0
/// Combines hidden objects that came in direct sight, one after the other, with those that did not.
#pragma once

#include <optional>
#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/grid/hidden_motion.h"
#include "blindcorner/simulation/perception.h"

namespace blindcorner {

/// Knows which objects have been seen, and follows each along x and y with a Kalman filter (nearly
/// constant velocity, as the scene's motion says).
class Sightings {
 public:
  /// `scene` must outlive it.
  Sightings(const Scene& scene, const Motion& motion);

  /// Notes the objects that are in sight ([hidden objects]) at a time (s) with their pose.
  /// `perceived` may know the velocity of an object that was not seen before.
  void see(const std::vector<bool>& in_sight, const PoseVector& pose, double time,
           const PerceptionAnswer& perceived = {});

  /// Whether any object has been in sight.
  bool any() const;

  /// What is known at a time (s). Objects that have been seen are where their track says. The
  /// others are where `perceived` says, moved on by `age` (s). If it says nothing, they are
  /// anywhere in their search region.
  PerceptionAnswer answer(const PerceptionAnswer& perceived, double age, double time) const;

 private:
  struct Sighting {
    PoseVector pose;                                           ///< as it was seen last
    double time = 0;                                           ///< s
    Eigen::Vector2d position = Eigen::Vector2d::Zero();        ///< m
    Eigen::Vector2d velocity = Eigen::Vector2d::Zero();        ///< m/s
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< of both, along each axis
  };
  /// A track at a later time.
  Sighting moved(const Sighting& sighting, double time) const;
  Sighting begun(std::size_t object, const PoseVector& pose,
                 const PerceptionAnswer& perceived) const;
  Eigen::Vector2d position_of(std::size_t object, const PoseVector& pose) const;
  PerceptionAnswer elsewhere(const PerceptionAnswer& perceived, double age) const;
  void pin(std::size_t object, double time, PoseMode& mode, PoseVelocity& velocity) const;

  const Scene& scene_;
  double acceleration_density_;  ///< m^2/s^3
  double initial_speed_;         ///< m/s
  HiddenMotion motion_;
  std::vector<std::optional<Sighting>> seen_;  ///< [hidden objects]
};

}  // namespace blindcorner
