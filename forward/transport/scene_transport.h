// SPDX-License-Identifier: Apache-2.0
/// Data that the fast models of one scene share, wherever the sensor stands.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/relay_setup.h"
#include "forward/sensor/pulse_table.h"
#include "forward/transport/path_grid.h"
#include "forward/transport/static_background.h"

namespace blindcorner {

/// Values made once for each key. Thread safe.
template <typename Key, typename Value>
class MadeOnce {
 public:
  template <typename Make>  // () -> std::shared_ptr<const Value>
  std::shared_ptr<const Value> get(const Key& key, const Make& make) {
    const std::scoped_lock lock(mutex_);
    for (const auto& [known, value] : made_) {
      if (known == key) return value;
    }
    made_.emplace_back(key, make());
    return made_.back().second;
  }

 private:
  std::mutex mutex_;
  std::vector<std::pair<Key, std::shared_ptr<const Value>>> made_;
};

/// Holds the tables for all options that were asked for so far. No option is a sensor pose, so
/// there are few tables: as many as extra pulse widths, tolerances and whole metres of `way_back`
/// are in use.
class SceneTransport {
 public:
  explicit SceneTransport(const Scene& all);
  /// For a scene with one object, whatever its shape.
  SceneTransport(const Scene& one, std::shared_ptr<const SurfaceRays> surface_rays);

  const Scene scene;
  const std::shared_ptr<const SurfaceRays> rays;
  const std::vector<OccluderFace> occluders;  ///< all of the scene's
  const std::vector<Placement> probes;        ///< of the (first) hidden object
  const std::vector<Transform> T_world_probes;
  /// Poses at which errors are estimated: a low-discrepancy sequence in the search region.
  const std::vector<PoseVector> probe_poses;
  /// Each object by itself, if there are several hidden objects or one that is not convex. Else
  /// empty.
  std::vector<std::shared_ptr<const SceneTransport>> objects;

  /// Pulses that are blurred by an extra Gaussian of variance `extra`, s^2, and by as much as the
  /// kernel asks for.
  std::shared_ptr<const PulseTable> pulses(double extra, Kernel kernel) const;
  /// Grid of paths for a Lambertian object. Legs may be as short as -`way_back` m.
  std::shared_ptr<const PathGrid> grid(PathGrid::Paths paths, double extra, double way_back,
                                       double tolerance) const;
  /// The known scene's own light.
  std::shared_ptr<const StaticBackgroundModel> static_background() const {
    return static_background_.get(
        0, [this] { return std::make_shared<const StaticBackgroundModel>(scene); });
  }
  /// Standard deviation of pulse, bin and extra pulse together, m of path.
  double pulse_sigma(double extra) const;

 private:
  struct PulseKey {
    double extra;
    Kernel kernel;
    bool operator==(const PulseKey&) const = default;
  };
  struct GridKey {
    PathGrid::Paths paths;
    double extra, way_back, tolerance;
    bool operator==(const GridKey&) const = default;
  };
  mutable MadeOnce<PulseKey, PulseTable> pulses_;
  mutable MadeOnce<GridKey, PathGrid> grids_;
  mutable MadeOnce<int, StaticBackgroundModel> static_background_;
};

}  // namespace blindcorner
