// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/path_outlook.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

constexpr double kNever = std::numeric_limits<double>::infinity();

VehicleState standing_at(const PathPoint& place, double rear_axle) {
  VehicleState state;
  state.position = place.position;
  state.yaw = yaw_on_path(place.heading, place.curvature, rear_axle);
  return state;
}

}  // namespace

void PathOutlookOptions::validate() const {
  const auto require = [](const char* field, double value, bool good) {
    if (good && std::isfinite(value)) return;
    throw Error("PathOutlookOptions." + std::string(field) + " = " + std::to_string(value) +
                "; accepted: metres " + (std::string(field) == "side_margin" ? ">= 0" : "> 0"));
  };
  require("horizon", horizon, horizon > 0);
  require("station_spacing", station_spacing, station_spacing > 0);
  require("side_margin", side_margin, side_margin >= 0);
}

PathOutlook::PathOutlook(std::vector<PathPoint> path, const VehicleRectangle& body,
                         const Transform& T_vehicle_sensor, const LineOfSight& sight,
                         const GridGeometry& grid, const PathOutlookOptions& options)
    : path_(std::move(path)),
      rear_axle_(body.rear_axle),
      T_vehicle_sensor_(T_vehicle_sensor),
      sight_(sight),
      grid_(grid),
      options_(options) {
  options_.validate();
  grid_.validate();
  if (path_.empty()) throw Error("path outlook", "the path has no points; accepted: 1 or more");
  const double begin = path_.front().arc_length, length = path_.back().arc_length - begin;
  const int pieces = std::max(1, static_cast<int>(std::ceil(length / options_.station_spacing)));
  for (int i = 0; i <= pieces; ++i) {
    stations_.push_back({path_at(path_, begin + length * i / pieces), {}, false});
  }
  find_touched(body, options_.side_margin);
}

/// Stamps the body along the path in steps of half a cell.
void PathOutlook::find_touched(const VehicleRectangle& body, double side_margin) {
  first_touched_.assign(grid_.cells(), kNever);
  const double half_length = body.length / 2, half_width = body.width / 2 + side_margin;
  const Vector2d reach = Vector2d::Constant(std::hypot(half_length, half_width));
  const double step = grid_.cell_size / 2;
  double before = path_.front().arc_length;
  for (double s = before;; s = std::min(s + step, path_.back().arc_length)) {
    const PathPoint place = path_at(path_, s);
    const double yaw = yaw_on_path(place.heading, place.curvature, body.rear_axle);
    const Vector2d along(std::cos(yaw), std::sin(yaw));
    const Vector2d center = place.position + body.center_x * along;
    for (const Cell& cell : grid_.cells_in({center - reach, center + reach})) {
      const Vector2d off = grid_.center(cell) - center;
      const double across = along.x() * off.y() - along.y() * off.x();
      if (std::abs(along.dot(off)) > half_length || std::abs(across) > half_width) continue;
      double& touched = first_touched_[grid_.index(cell)];
      touched = std::min(touched, before);
    }
    if (s >= path_.back().arc_length) break;
    before = s;
  }
}

const std::vector<std::size_t>& PathOutlook::seen_from(Station& station) {
  if (!station.looked) {
    const VehicleState state = standing_at(station.place, rear_axle_);
    station.sees = sight_.scan(T_world_vehicle(state) * T_vehicle_sensor_).free;
    station.looked = true;
  }
  return station.sees;
}

std::vector<Encounter> PathOutlook::encounters(std::span<const PoseHypothesis> hypotheses,
                                               double from) {
  std::vector<double> first_seen(grid_.cells(), kNever);
  for (auto at = stations_.rbegin(); at != stations_.rend(); ++at) {
    Station& station = *at;
    const double s = station.place.arc_length;
    if (s > from + options_.horizon) continue;
    if (s < from) break;
    for (const std::size_t cell : seen_from(station)) first_seen[cell] = s;
  }
  std::vector<Encounter> encounters;
  for (const PoseHypothesis& hypothesis : hypotheses) {
    if (!(hypothesis.probability > 0)) continue;
    Encounter encounter{hypothesis.probability, kNever, kNever};
    for (const std::size_t cell : hypothesis.touches) {
      encounter.contact = std::min(encounter.contact, first_touched_[cell]);
    }
    if (!(encounter.contact >= from && encounter.contact <= from + options_.horizon)) continue;
    for (const std::size_t cell : hypothesis.covers) {
      encounter.sight = std::min(encounter.sight, first_seen[cell]);
    }
    encounters.push_back(encounter);
  }
  return encounters;
}

}  // namespace blindcorner
