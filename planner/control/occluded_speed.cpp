// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/occluded_speed.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <string>
#include <utility>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

constexpr float kNobody = std::numeric_limits<float>::infinity();
/// People who take longer to come are not followed, s: by then every vehicle here stands.
constexpr float kLooksAhead = 4;
/// Distance along the path between the places of the front that are checked, m.
constexpr double kFrontSpacing = 0.5;
/// Time between checks of the front while the vehicle brakes, s.
constexpr double kStep = 0.05;
/// Step of the speeds that are tried, m/s.
constexpr double kSpeedStep = 0.25;
/// Steps to eight neighbours are longer than the straight way by at most this factor.
constexpr double kDetour = 1.0824;
/// Comfortable braking as a share of the friction limit. The vehicle slows down with it for places
/// ahead, and it says how far ahead to look.
constexpr double kComfortable = 0.4;

struct Step {
  float time;
  std::size_t cell;
  bool operator>(const Step& other) const { return time > other.time; }
};

}  // namespace

void OccludedSpeedOptions::validate() const {
  const auto require = [](const char* field, double value, bool good, const char* accepted) {
    if (good && std::isfinite(value)) return;
    throw Error("OccludedSpeedOptions." + std::string(field) + " = " + std::to_string(value) +
                "; accepted: " + accepted);
  };
  require("speed", speed, speed >= 0, "m/s >= 0");
  require("reaction_time", reaction_time, reaction_time >= 0, "seconds >= 0");
  require("margin", margin, margin >= 0, "metres >= 0");
  require("side_margin", side_margin, side_margin >= 0, "metres >= 0");
  require("station_spacing", station_spacing, station_spacing > 0, "metres > 0");
}

OccludedSpeed::OccludedSpeed(const LineOfSight& sight, const GridGeometry& grid,
                             const std::vector<Cell>& walls, const VehicleRectangle& body,
                             const Transform& T_vehicle_sensor, const OccludedSpeedOptions& options)
    : sight_(sight),
      grid_(grid),
      body_(body),
      T_vehicle_sensor_(T_vehicle_sensor),
      options_(options),
      wall_(grid.cells()),
      earliest_(grid.cells(), 0) {
  options_.validate();
  for (const Cell& cell : walls) wall_[grid_.index(cell)] = true;
  for (std::size_t i = 0; i < wall_.size(); ++i) {
    if (wall_[i]) earliest_[i] = kNobody;
  }
}

/// Cells that are seen are empty. The times of other cells ahead count down, and from these cells
/// people enter others (Dijkstra 1959).
void OccludedSpeed::advance(std::vector<float>& earliest, double dt,
                            const VehicleState& state) const {
  const Transform T_world_vehicle_now = T_world_vehicle(state);
  const Transform T_world_sensor = T_world_vehicle_now * T_vehicle_sensor_;
  const Vector2d sensor = T_world_sensor.translation().head<2>();
  const Vector2d ahead = T_world_vehicle_now.linear().col(0).head<2>();
  const LineOfSightScan scan = sight_.scan(T_world_sensor);
  for (const std::size_t i : scan.free) earliest[i] = kNobody;
  for (const std::size_t i : scan.surface_hits) earliest[i] = kNobody;
  std::vector<bool> open(earliest.size());
  std::vector<std::size_t> sources;
  for (std::size_t i = 0; i < earliest.size(); ++i) {
    if (wall_[i] || ahead.dot(grid_.center(grid_.cell(i)) - sensor) < 0) {
      earliest[i] = kNobody;
      continue;
    }
    open[i] = true;
    if (earliest[i] == kNobody) continue;
    earliest[i] = std::max(0.0F, earliest[i] - static_cast<float>(dt));
    sources.push_back(i);
  }
  if (options_.speed > 0) spread(earliest, open, sources);
}

void OccludedSpeed::spread(std::vector<float>& earliest, const std::vector<bool>& open,
                           const std::vector<std::size_t>& sources) const {
  const std::array<std::pair<int, int>, 8> around{
      {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {1, -1}, {-1, 1}, {-1, -1}}};
  std::priority_queue<Step, std::vector<Step>, std::greater<>> next;
  const auto go_on = [&](std::size_t from) {
    const Cell cell = grid_.cell(from);
    for (const auto& [column, row] : around) {
      const Cell to{cell.column + column, cell.row + row};
      if (!grid_.contains(to)) continue;
      const std::size_t i = grid_.index(to);
      if (!open[i]) continue;
      const double way = grid_.cell_size * std::hypot(column, row) / kDetour;
      const float time = earliest[from] + static_cast<float>(way / options_.speed);
      if (time >= earliest[i] || time > kLooksAhead) continue;
      earliest[i] = time;
      next.push({time, i});
    }
  };
  std::ranges::for_each(sources, go_on);
  while (!next.empty()) {
    const Step step = next.top();
    next.pop();
    if (step.time <= earliest[step.cell]) go_on(step.cell);
  }
}

void OccludedSpeed::see(double dt, const VehicleState& state) { advance(earliest_, dt, state); }

/// The earliest time at which somebody may be where the front is, from kFrontSpacing behind the
/// front to the margin ahead of it.
float OccludedSpeed::at_front(const std::vector<float>& earliest, const PathPoint& place) const {
  const double yaw = yaw_on_path(place.heading, place.curvature, body_.rear_axle);
  const Vector2d along(std::cos(yaw), std::sin(yaw));
  const Vector2d front = place.position + (body_.center_x + body_.length / 2) * along;
  const double half_width = body_.width / 2 + options_.side_margin;
  const Vector2d reach =
      Vector2d::Constant(std::hypot(half_width, std::max(kFrontSpacing, options_.margin)));
  float first = kNobody;
  for (const Cell& cell : grid_.cells_in({front - reach, front + reach})) {
    const Vector2d off = grid_.center(cell) - front;
    const double ahead = along.dot(off), across = along.x() * off.y() - along.y() * off.x();
    if (ahead < -kFrontSpacing || ahead > options_.margin || std::abs(across) > half_width)
      continue;
    first = std::min(first, earliest[grid_.index(cell)]);
  }
  return first;
}

/// `at_fronts` holds at_front() at places of the path, kFrontSpacing apart, from the vehicle's own
/// place on.
double OccludedSpeed::largest_speed(const std::vector<float>& at_fronts, double wanted,
                                    double friction) const {
  const auto meets = [&](double speed) {
    for (double t = 0; t < kLooksAhead; t += kStep) {
      const double braked = std::max(0.0, t - options_.reaction_time);
      if (speed - friction * braked <= 0) return false;
      const double way = speed * t - 0.5 * friction * braked * braked;
      const auto i = static_cast<std::size_t>(way / kFrontSpacing);
      if (i < at_fronts.size() && static_cast<double>(at_fronts[i]) <= t) return true;
    }
    return false;
  };
  // From this speed the vehicle stops within the margin: it may always drive so slowly.
  const double b = friction, t = options_.reaction_time;
  double speed = std::min(wanted, std::sqrt(b * b * t * t + 2 * b * options_.margin) - b * t);
  while (speed < wanted && !meets(std::min(wanted, speed + kSpeedStep))) {
    speed = std::min(wanted, speed + kSpeedStep);
  }
  return speed;
}

std::vector<double> OccludedSpeed::limits(const std::vector<PathPoint>& path, double from,
                                          double wanted, double friction) const {
  std::vector<double> speeds(path.size(), std::numeric_limits<double>::infinity());
  if (path.empty()) return speeds;
  const double end = path.back().arc_length;
  const double horizon = 0.5 * wanted * wanted / (kComfortable * friction) + body_.length;
  std::vector<double> places, found;
  std::vector<float> earliest = earliest_;
  for (double s = from; s <= std::min(end, from + horizon); s += options_.station_spacing) {
    if (!found.empty()) {
      VehicleState state;
      const PathPoint place = path_at(path, s);
      state.position = place.position;
      state.yaw = yaw_on_path(place.heading, place.curvature, body_.rear_axle);
      advance(earliest, options_.station_spacing / found.back(), state);
    }
    std::vector<float> at_fronts;
    const double reach =
        wanted * options_.reaction_time + 0.5 * wanted * wanted / friction + kFrontSpacing;
    for (double x = s; x <= std::min(end, s + reach); x += kFrontSpacing) {
      at_fronts.push_back(at_front(earliest, path_at(path, x)));
    }
    places.push_back(s);
    found.push_back(largest_speed(at_fronts, wanted, friction));
  }
  for (std::size_t i = 0; i < path.size(); ++i) {
    const double s = path[i].arc_length;
    if (places.empty() || s < places.front() || s > places.back()) continue;
    const auto after = std::ranges::upper_bound(places, s) - places.begin();
    const auto k = static_cast<std::size_t>(
        std::clamp<std::ptrdiff_t>(after, 1, std::max<std::ptrdiff_t>(1, std::ssize(places) - 1)));
    speeds[i] = k < found.size() ? std::min(found[k - 1], found[k]) : found[k - 1];
  }
  return speeds;
}

}  // namespace blindcorner
