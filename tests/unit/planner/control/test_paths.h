// SPDX-License-Identifier: Apache-2.0
/// Paths with closed forms.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "blindcorner/planner/path/path.h"

namespace blindcorner {

/// Straight for `before` m along +x, left through `angle` rad on `radius` m, straight again.
inline std::vector<PathPoint> turn_path(double radius, double before, double angle, double after,
                                        double spacing) {
  std::vector<PathPoint> path;
  const double total = before + radius * angle + after;
  const auto pieces = static_cast<int>(std::ceil(total / spacing - 1e-9));
  for (int i = 0; i <= pieces; ++i) {
    const double s = total * i / pieces;
    const double turned = std::min(std::max(s - before, 0.0) / radius, angle);
    const double beyond = std::max(0.0, s - before - radius * angle);
    PathPoint sample;
    sample.arc_length = s;
    sample.heading = turned;
    sample.curvature = s >= before && s < before + radius * angle ? 1 / radius : 0;
    sample.position = {std::min(s, before) + radius * std::sin(turned) + beyond * std::cos(turned),
                       radius * (1 - std::cos(turned)) + beyond * std::sin(turned)};
    path.push_back(sample);
  }
  return path;
}

inline std::vector<PathPoint> straight_path(double length, double spacing) {
  return turn_path(1, length, 0, 0, spacing);
}

inline std::vector<PathPoint> l_turn(double radius, double straight, double spacing) {
  return turn_path(radius, straight, std::numbers::pi / 2, straight, spacing);
}

/// The same path turned to the right.
inline std::vector<PathPoint> mirrored(std::vector<PathPoint> path) {
  for (PathPoint& sample : path) {
    sample.position.y() = -sample.position.y();
    sample.heading = -sample.heading;
    sample.curvature = -sample.curvature;
  }
  return path;
}

}  // namespace blindcorner
