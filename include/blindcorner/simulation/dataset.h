// SPDX-License-Identifier: Apache-2.0
/// Training data sets: captures of an object on a grid of places, from several poses of the sensor.
/// The simulated sensor of a drive takes the captures.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"

namespace blindcorner {

/// The default numbers are those of the published data.
struct DatasetOptions {
  int objects = 400;  ///< places of the object, a square number: a grid of 20 x 20
  int sensors = 5;    ///< poses of the sensor: the scene's own, and others around it
  /// > 0: number of captures, instead of a grid. Each capture has its own place of the object and
  /// its own pose of the sensor, all drawn at random. This suits a method that learns from many
  /// captures best.
  int random = 0;
  int exposures = 10;  ///< exposures averaged in each capture
  /// The other poses are within this distance (m) of the scene's own pose along x and along y.
  /// Empty: 5 % of the distance at which the optical axis meets a surface (of 1 m if it meets
  /// none).
  std::optional<double> sensor_spread;
  double sensor_yaw_spread = 0.035;  ///< rad, to either side
  std::uint64_t seed = 1;            ///< seed of poses and photons

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Where object and sensor stand in the captures of a data set.
struct DatasetPlan {
  int side = 0;                     ///< places along x and along y; 0: no grid
  double sensor_spread = 0;         ///< m, as used
  std::vector<Transform> sensors;   ///< [sensors] T_world_sensor
  std::vector<PoseVector> objects;  ///< [objects], x changes fastest
  bool paired = false;              ///< one sensor pose for each object, instead of all poses

  std::size_t captures() const { return objects.size() * (paired ? 1 : sensors.size()); }
};

/// Spreads the places of the first object evenly over the range of its x and of its y, both ends
/// included. All other unknowns are drawn from the scene's prior, once for each place. With
/// `random` > 0, all unknowns are drawn from the prior instead. Throws Error for a grid of a scene
/// whose first object has no unknown x or y, and if a pose of the sensor lights or sees no relay
/// surface.
DatasetPlan plan_dataset(const Scene& scene, const DatasetOptions& options);

/// Captures [plan.captures()], each with its truth and the sensor's pose. Captures of one place of
/// the object are side by side. They are the same at any number of threads. `advance` is called
/// after each capture, from any thread.
std::vector<Capture> render_dataset(const Scene& scene, const DatasetPlan& plan,
                                    const DatasetOptions& options,
                                    const std::function<void()>& advance = {});

}  // namespace blindcorner
