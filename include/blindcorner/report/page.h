// SPDX-License-Identifier: Apache-2.0
/// `result.html`: the results of a fit as one page that needs no network; the same page of a scene
/// before anything is fitted.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// How one capture was taken, as far as the page draws it.
struct CaptureConditions {
  Transform T_world_sensor = Transform::Identity();
  std::vector<Eigen::Vector3d> relay_points;  ///< [zones], m, world; empty: the scene's zones
  std::vector<double> variance_floor;         ///< [zones] counts^2
  std::vector<double> variance_per_count;     ///< [zones] counts, per expected count on top of that
};

/// Conditions of a capture: its own where it has them, the scene's otherwise.
CaptureConditions conditions_of(const Scene& scene, const Capture& capture);

struct PageOptions {
  /// Captures whose histograms are embedded at most; they are spread evenly over all of them. The
  /// modes of all captures are always there.
  int max_histogram_captures = 60;
  /// Zones embedded per capture at most: those with most light from the object.
  int max_zones = 64;
  /// Histogram bins embedded in the whole page at most; each takes about 20 bytes.
  int max_bins = 600'000;
};

/// The page. `conditions[i]` lists the conditions of the captures of `results[i]` in their order;
/// where a list is missing or too short the scene's own are taken.
std::string result_page(const Scene& scene, const std::vector<FitResult>& results,
                        const std::vector<std::vector<CaptureConditions>>& conditions = {},
                        const PageOptions& options = {});

/// The scene alone, as that page draws it: surfaces, what the sensor sees, the search region and
/// the object where the scene file puts it.
std::string scene_page(const Scene& scene);

}  // namespace blindcorner
