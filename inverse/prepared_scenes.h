// SPDX-License-Identifier: Apache-2.0
/// A scene that is compiled once for each sensor placement: what fits of it share.
#pragma once

#include <atomic>
#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <vector>

#include "inverse/posterior/detection.h"
#include "inverse/posterior/fisher_information.h"
#include "inverse/search/compiled_scene.h"

namespace blindcorner {

/// A scene compiled for certain sensor placements.
struct Prepared {
  std::vector<SensorPlacement> placements;
  std::once_flag once;
  std::unique_ptr<CompiledScene> compiled;
  /// With the ranges near the relay, where these are a small part; its finer grid gives starts.
  /// Null until a fit searches: a frame that is tracked does not.
  std::once_flag near_once;
  std::unique_ptr<CompiledScene> near;
  std::unique_ptr<MovedModels> moved;
  std::unique_ptr<FalseAlarmCalibration> false_alarms;  ///< null until somebody asks
  std::atomic<std::size_t> bytes{0};                    ///< 0 until it is compiled

  /// For who has fitted with this.
  void count_bytes() { bytes = compiled->bytes() + (near ? near->bytes() : 0); }
};

/// The scene at the sensor placements that were asked for last, as many as fit into
/// FitOptions::cache_bytes. Thread safe.
class PreparedScenes {
 public:
  /// Both must outlive this, where they are.
  PreparedScenes(const Scene& scene, const FitOptions& options);

  /// The scene compiled for these placements; compiled once, by whoever comes first.
  std::shared_ptr<Prepared> at(const std::vector<SensorPlacement>& placements);

  /// The part near the relay, where the scene needs one; null where it does not.
  const CompiledScene* near_relay(Prepared& whole) const;

  /// What is known about empty captures. Their law hardly depends on where the sensor stands: that
  /// of the scene's own sensor placement serves all single captures of a sensor that moves.
  /// Kept for as long as this is: other threads may be asking it while the cache lets it go.
  FalseAlarmCalibration& false_alarms(const std::shared_ptr<Prepared>& own);

 private:
  std::shared_ptr<Prepared> find(const std::vector<SensorPlacement>& placements);
  void drop_least_used();
  GridOptions grid_options() const;

  const Scene& scene_;
  const FitOptions& options_;
  std::shared_ptr<const SceneKnowledge> knowledge_;
  std::mutex mutex_;
  std::list<std::shared_ptr<Prepared>> prepared_;  ///< last used first
  std::once_flag home_once_;
  std::shared_ptr<Prepared> home_;  ///< at the scene's own sensor placement; kept
};

}  // namespace blindcorner
