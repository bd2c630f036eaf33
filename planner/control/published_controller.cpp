// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/published_controller.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "planner/require_positive.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

/// The traversable cell nearest to a point, at most `reach` m from it.
std::optional<Cell> nearest_traversable(const PlanningGrid& grid, const Vector2d& point,
                                        double reach) {
  const GridGeometry& geometry = grid.geometry();
  const Cell middle = geometry.cell_at(point);
  const int most = static_cast<int>(std::ceil(reach / geometry.cell_size));
  std::optional<Cell> nearest;
  double least = reach;
  for (int row = middle.row - most; row <= middle.row + most; ++row) {
    for (int column = middle.column - most; column <= middle.column + most; ++column) {
      const Cell cell{column, row};
      if (!grid.traversable(cell)) continue;
      const double distance = (geometry.center(cell) - point).norm();
      if (distance > least) continue;
      least = distance;
      nearest = cell;
    }
  }
  return nearest;
}

/// The point at a length along a line through points, m; beyond the line, its end.
Vector2d along(const std::vector<Vector2d>& line, double length) {
  for (std::size_t i = 1; i < line.size(); ++i) {
    const double step = (line[i] - line[i - 1]).norm();
    if (length <= step)
      return line[i - 1] + length / std::max(step, 1e-12) * (line[i] - line[i - 1]);
    length -= step;
  }
  return line.back();
}

double length_of(const std::vector<Vector2d>& line) {
  double length = 0;
  for (std::size_t i = 1; i < line.size(); ++i) length += (line[i] - line[i - 1]).norm();
  return length;
}

}  // namespace

Vector2d BezierCurve::at(double t) const {
  const double s = 1 - t;
  return s * s * s * control[0] + 3 * s * s * t * control[1] + 3 * s * t * t * control[2] +
         t * t * t * control[3];
}

double BezierCurve::first_curvature() const {
  const Vector2d first = control[1] - control[0], second = control[2] - control[1];
  const double length = first.norm();
  return length > 0 ? 2.0 / 3.0 * cross(first, second) / (length * length * length) : 0.0;
}

PublishedControllerOptions PublishedControllerOptions::of_length(double length) {
  PublishedControllerOptions options;
  options.horizon *= length / 4.5;
  options.reached *= length / 4.5;
  return options;
}

void PublishedControllerOptions::validate() const {
  const auto positive = [](const char* field, double value) {
    require_positive("PublishedControllerOptions", field, value);
  };
  positive("horizon", horizon);
  positive("reached", reached);
  positive("steering_gain", steering_gain);
  positive("speed_gain", speed_gain);
  if (!(feed_forward >= 0)) {
    throw Error("PublishedControllerOptions.feed_forward", "accepted: a number >= 0");
  }
}

PublishedController::PublishedController(const VehicleLimits& limits,
                                         const PublishedControllerOptions& options)
    : limits_(limits), options_(options) {
  options_.validate();
}

PathStatus PublishedController::plan(const PlanningGrid& grid, const VehicleState& state,
                                     const PathGoal& goal, double reach) {
  const Vector2d target = goal.line_to ? Vector2d(0.5 * (goal.point + *goal.line_to)) : goal.point;
  const auto from = nearest_traversable(grid, state.position, reach);
  const auto to = nearest_traversable(grid, target, reach);
  if (!from || !to) return from ? PathStatus::goal_blocked : PathStatus::start_blocked;
  const CellPath way = search_.search(grid, *from, *to);
  if (way.status != PathStatus::found) return way.status;
  std::vector<Vector2d> line{state.position};
  for (std::size_t i = 1; i < way.cells.size(); ++i) {
    line.push_back(grid.geometry().center(way.cells[i]));
  }
  line.push_back(target);
  const double horizon = std::min(options_.horizon, length_of(line));
  for (std::size_t i = 0; i < curve_.control.size(); ++i) {
    curve_.control[i] = along(line, horizon * static_cast<double>(i) / 3);
  }
  rest_.clear();
  double length = 0;
  for (std::size_t i = 1; i < line.size(); ++i) {
    length += (line[i] - line[i - 1]).norm();
    if (length > horizon) rest_.push_back(line[i]);
  }
  planned_ = true;
  return PathStatus::found;
}

DriveRequest PublishedController::follow(const VehicleState& state, double speed) const {
  DriveRequest request;
  request.acceleration = options_.speed_gain * (speed - state.speed);
  if (!planned_) return request;
  const Vector2d towards = curve_.control[1] - state.position;
  const double distance = towards.norm();
  if (distance < options_.reached) return request;
  const double error = std::remainder(std::atan2(towards.y(), towards.x()) - state.yaw, 2 * kPi);
  const double wanted =
      options_.steering_gain * error / distance + options_.feed_forward * curve_.first_curvature();
  request.curvature = std::clamp(wanted, -limits_.curvature, limits_.curvature);
  return request;
}

std::vector<Vector2d> PublishedController::points() const {
  constexpr int kPieces = 12;
  std::vector<Vector2d> points;
  if (!planned_) return points;
  for (int i = 0; i <= kPieces; ++i) points.push_back(curve_.at(static_cast<double>(i) / kPieces));
  points.insert(points.end(), rest_.begin(), rest_.end());
  return points;
}

}  // namespace blindcorner
