// SPDX-License-Identifier: Apache-2.0
/// Data sets to learn from: captures of an object on a grid of places, from several poses of the
/// sensor, as the simulated sensor of a drive senses them.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// Numbers are those of the published data.
struct DatasetOptions {
  int objects = 400;  ///< places of the object, a square number: a grid of 20 x 20
  int sensors = 5;    ///< poses of the sensor: the scene's own, and others around it
  /// > 0: so many captures instead, each with an object's place and a pose of the sensor of its
  /// own, all drawn at random: what a learner of many captures is served best with.
  int random = 0;
  int exposures = 10;  ///< averaged in each capture
  /// The other poses are within this distance of the scene's own along x and along y, m. Empty: 5 %
  /// of the distance at which the optical axis meets a surface (of 1 m where it meets none).
  std::optional<double> sensor_spread;
  double sensor_yaw_spread = 0.035;  ///< rad, to either side
  std::uint64_t seed = 1;            ///< of poses and photons

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Where object and sensor stand in the captures of a data set.
struct DatasetPlan {
  int side = 0;                     ///< places along x and along y
  double sensor_spread = 0;         ///< m, as used
  std::vector<Transform> sensors;   ///< [sensors] T_world_sensor
  std::vector<PoseVector> objects;  ///< [objects], x changes fastest
  bool paired = false;              ///< one sensor for each object, not all for each

  std::size_t captures() const { return objects.size() * (paired ? 1 : sensors.size()); }
};

/// Places of the first object are evenly spread over the range of its x and of its y, both ends
/// included; all other unknowns are drawn from the scene's prior, once for each place. Throws Error
/// for a scene whose first object has no unknown x or y, and when a pose of the sensor lights or
/// sees no relay.
DatasetPlan plan_dataset(const Scene& scene, const DatasetOptions& options);

/// Captures [plan.captures()], those of one place of the object side by side, each with its truth
/// and the sensor's pose. The same at any number of threads. `advance` is called after each, from
/// any thread.
std::vector<Capture> render_dataset(const Scene& scene, const DatasetPlan& plan,
                                    const DatasetOptions& options,
                                    const std::function<void()>& advance = {});

}  // namespace blindcorner
