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
  /// The scene with ranges near the relay, if these are a small part of the search region. Its
  /// finer grid gives starts. Null until a fit searches, which the fit of a tracked frame does not.
  std::once_flag near_once;
  std::unique_ptr<CompiledScene> near;
  std::unique_ptr<MovedModels> moved;
  std::unique_ptr<FalseAlarmCalibration> false_alarms;  ///< null until somebody asks
  std::atomic<std::size_t> bytes{0};                    ///< 0 until it is compiled

  /// Updates `bytes` after a fit, which may have compiled more.
  void count_bytes() { bytes = compiled->bytes() + (near ? near->bytes() : 0); }
};

/// The scene at the sensor placements that were asked for last, as many as fit into
/// FitOptions::cache_bytes. Thread safe.
class PreparedScenes {
 public:
  /// Both must outlive this object and stay where they are.
  PreparedScenes(const Scene& scene, const FitOptions& options);

  /// The scene compiled for these placements. It is compiled once, by whoever asks first.
  std::shared_ptr<Prepared> at(const std::vector<SensorPlacement>& placements);

  /// The part near the relay, where the scene needs one; null where it does not.
  const CompiledScene* near_relay(Prepared& whole) const;

  /// What is known about empty captures. Their law hardly depends on where the sensor stands, so
  /// that the law at the scene's own sensor placement serves all single captures of a moving
  /// sensor. The scene compiled there is kept as long as this object, because other threads may use
  /// it while the cache drops it.
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
