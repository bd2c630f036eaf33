// SPDX-License-Identifier: Apache-2.0
/// `result.html`: the results of a fit as one page that needs no network, and the same page for a
/// scene before any fit.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// Conditions of one capture, as far as the page draws them.
struct CaptureConditions {
  Transform T_world_sensor = Transform::Identity();
  std::vector<Eigen::Vector3d> relay_points;  ///< [zones], m, world; empty: the scene's zones
  std::vector<double> variance_floor;         ///< [zones] counts^2
  std::vector<double> variance_per_count;     ///< [zones] counts, added per expected count
};

/// Conditions of a capture: its own where it has them, otherwise the scene's.
CaptureConditions conditions_of(const Scene& scene, const Capture& capture);

struct PageOptions {
  /// Largest number of captures whose histograms are embedded; they are spread evenly over all
  /// captures. The modes of all captures are always embedded.
  int max_histogram_captures = 60;
  /// Largest number of zones embedded per capture: those with most light from the object.
  int max_zones = 64;
  /// Largest number of histogram bins embedded in the whole page; each takes about 20 bytes.
  int max_bins = 600'000;
};

/// The page. `conditions[i]` lists the conditions of the captures of `results[i]` in their order.
/// If a list is missing or too short, the scene's own conditions are used.
std::string result_page(const Scene& scene, const std::vector<FitResult>& results,
                        const std::vector<std::vector<CaptureConditions>>& conditions = {},
                        const PageOptions& options = {});

/// The scene alone, as the page of a fit draws it: surfaces, the sensor's view, the search region,
/// and the object where the scene file puts it.
std::string scene_page(const Scene& scene);

}  // namespace blindcorner
