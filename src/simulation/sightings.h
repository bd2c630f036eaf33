// SPDX-License-Identifier: Apache-2.0
/// Hidden objects that came in direct sight, one after the other, beside those that have not.
#pragma once

#include <optional>
#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/grid/hidden_motion.h"
#include "blindcorner/simulation/perception.h"

namespace blindcorner {

/// Knows which objects have been seen, and where last.
class Sightings {
 public:
  /// `scene` must outlive it.
  Sightings(const Scene& scene, const Motion& motion);

  /// Notes the objects that are in sight ([hidden objects]) at a time (s) with their pose.
  void see(const std::vector<bool>& in_sight, const PoseVector& pose, double time);

  /// Whether any object has been in sight.
  bool any() const;

  /// What is known at a time (s): objects that have been seen stand where they were last, within a
  /// known pose's deviations and what may have moved since; the others are as `perceived` says,
  /// moved on by `age` (s), and anywhere in their search region where it says nothing. Velocities
  /// of seen objects are any.
  PerceptionAnswer answer(const PerceptionAnswer& perceived, double age, double time) const;

 private:
  struct Sighting {
    PoseVector pose;
    double time = 0;  ///< s
  };
  PerceptionAnswer elsewhere(const PerceptionAnswer& perceived, double age) const;
  void pin(std::size_t object, double time, PoseMode& mode, PoseVelocity& velocity) const;

  const Scene& scene_;
  HiddenMotion motion_;
  std::vector<std::optional<Sighting>> seen_;  ///< [hidden objects]
};

}  // namespace blindcorner
