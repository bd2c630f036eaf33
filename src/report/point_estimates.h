// SPDX-License-Identifier: Apache-2.0
/// Estimates against the truth.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

struct PointEstimate {
  std::string source;  ///< file of the capture
  int index = 0;       ///< its place there
  PoseVector truth;
  PoseVector estimate;
  PoseVector sigma{};  ///< its stated standard deviations; empty: none are stated
  Transform T_world_sensor = Transform::Identity();
};

/// Figures of the absolute errors of one unknown, or of the lengths of errors of position; m, rad
/// or 1.
struct ErrorFigures {
  std::string name;  ///< of the unknown, or "position_m"
  double mean = 0, rmse = 0, median = 0, p90 = 0;
};

/// Lengths of errors of position over its unknown coordinates, m; empty where there are none.
std::vector<double> position_errors(const Scene& scene,
                                    const std::vector<PointEstimate>& estimates);

/// The unknowns in order, then "position_m": the Euclidean length over all unknown coordinates of
/// position, where there are any. Yaw is compared modulo the symmetry of the shape. Throws Error
/// without estimates.
std::vector<ErrorFigures> point_errors(const Scene& scene,
                                       const std::vector<PointEstimate>& estimates);

/// {"x_m": {"mean_absolute": ..., "rmse": ..., "median": ..., "p90": ...}, ...}
nlohmann::ordered_json point_errors_json(const std::vector<ErrorFigures>& figures);
/// Tables for a terminal and for a page.
std::string point_errors_text(const std::vector<ErrorFigures>& figures);
std::string point_errors_html(const std::vector<ErrorFigures>& figures);

/// How far off the estimates are, in a sentence; empty without positions.
std::string point_errors_headline(const Scene& scene, const std::vector<PointEstimate>& estimates);

/// A row for each estimate: source, index, then for each unknown the truth, the estimate, the error
/// and, where it is stated, the standard deviation.
std::string point_estimates_csv(const Scene& scene, const std::vector<PointEstimate>& estimates);

/// Bird's-eye view: known surfaces, sensors, a line from each true place to the estimate. Empty for
/// a scene whose first object has no unknown x or y.
std::string point_estimates_svg(const Scene& scene, const std::vector<PointEstimate>& estimates);

}  // namespace blindcorner
