// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/grid/line_of_sight.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <string>

#include "blindcorner/forward/error.h"
#include "forward/relay/ray_scene.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Distance behind a surface at which the cell that it occupies is looked up, in cells: a wall on
/// the line between two cells belongs to the cell that it hides.
constexpr double kBehind = 0.01;

/// What a scan says of a cell. Of several marks the greatest holds.
enum Mark : std::uint8_t { kNothing, kFree, kSurface, kObject };

/// Marks cells free from a point along a direction (unit) up to a distance: the cells that the
/// line crosses, in order (Amanatides & Woo 1987).
void mark_free(const GridGeometry& grid, const Vector2d& from, const Vector2d& direction,
               double distance, std::vector<std::uint8_t>& marks) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  Cell cell = grid.cell_at(from);
  Vector2d next, step;  // distance to the next border of a column or row, and between two
  for (const int axis : {0, 1}) {
    const double along = direction[axis];
    const double border = grid.center(cell)[axis] + std::copysign(grid.cell_size / 2, along);
    next[axis] = along != 0 ? (border - from[axis]) / along : kNever;
    step[axis] = along != 0 ? grid.cell_size / std::abs(along) : kNever;
  }
  for (double at = 0; at < distance;) {
    if (grid.contains(cell)) {
      std::uint8_t& mark = marks[grid.index(cell)];
      mark = std::max<std::uint8_t>(mark, kFree);
    }
    const int axis = next.x() < next.y() ? 0 : 1;
    at = next[axis];
    next[axis] += step[axis];
    (axis == 0 ? cell.column : cell.row) += direction[axis] > 0 ? 1 : -1;
  }
}

/// Direction of a sensor's forward axis over the ground, rad.
double heading(const Transform& T_world_sensor) {
  const Vector3d forward = T_world_sensor.linear().col(0);
  return std::atan2(forward.y(), forward.x());
}

[[noreturn]] void refuse(const std::string& field, double found, const std::string& accepted) {
  throw Error("LineOfSightOptions." + field + " = " + std::to_string(found) +
              "; accepted: " + accepted);
}

}  // namespace

void LineOfSightOptions::validate() const {
  if (!(max_range > 0) || !std::isfinite(max_range)) refuse("max_range", max_range, "metres > 0");
  if (!(field_of_view > 0 && field_of_view <= 2 * std::numbers::pi)) {
    refuse("field_of_view", field_of_view, "radians > 0, at most 2 pi");
  }
  if (!std::isfinite(lowest)) refuse("lowest", lowest, "metres");
  if (!(highest >= lowest) || !std::isfinite(highest)) {
    refuse("highest", highest, "metres, at least those of `lowest`");
  }
  if (layers < 1) refuse("layers", layers, "1 or more");
}

/// Where the rays of one direction end.
struct LineOfSight::End {
  double distance = 0;    ///< m
  Mark mark = kNothing;   ///< what they end on; kNothing: the end of their range
  Vector2d hidden{0, 0};  ///< m, a little behind the surface
  int body = -1;          ///< index of the surface or hidden object that they end on
};

LineOfSight::LineOfSight(const Scene& scene, const GridGeometry& grid,
                         const LineOfSightOptions& options)
    : grid_(grid), options_(options), surfaces_(std::make_unique<RayScene>(scene.surfaces)) {
  grid_.validate();
  options_.validate();
  for (int i = 0; i < object_count(scene); ++i) objects_.push_back(hidden_object(scene, i));
}

LineOfSight::~LineOfSight() = default;

LineOfSight::End LineOfSight::nearest_end(const Vector2d& from, const Vector2d& direction,
                                          const RayScene* bodies) const {
  End end{options_.max_range};
  const Vector3d level(direction.x(), direction.y(), 0);
  const auto look = [&](const RayScene& rays, const Vector3d& origin, Mark mark) {
    const std::optional<RayHit> hit = rays.first_hit(origin, level);
    if (!hit || hit->distance >= end.distance) return;
    const double side = hit->normal.dot(level) > 0 ? 1 : -1;
    const Vector3d behind = hit->point + side * kBehind * grid_.cell_size * hit->normal;
    end = {hit->distance, mark, behind.head<2>(), hit->surface};
  };
  for (int layer = 0; layer < options_.layers; ++layer) {
    const double share = options_.layers > 1 ? layer / (options_.layers - 1.0) : 0.0;
    const double height = options_.lowest + share * (options_.highest - options_.lowest);
    const Vector3d origin(from.x(), from.y(), height);
    look(*surfaces_, origin, kSurface);
    if (bodies != nullptr) look(*bodies, origin, kObject);
  }
  return end;
}

LineOfSightScan LineOfSight::scan(const Transform& T_world_sensor,
                                  const std::vector<Placement>& objects,
                                  const Transform& T_world_believed) const {
  if (!objects.empty() && objects.size() != objects_.size()) {
    throw Error("line of sight",
                std::to_string(objects.size()) + " placements; accepted: none or " +
                    std::to_string(objects_.size()) + ", one for each hidden object");
  }
  const Vector2d from = T_world_sensor.translation().head<2>();
  if (!T_world_sensor.matrix().allFinite() || !T_world_believed.matrix().allFinite())
    throw Error("line of sight", "the pose is not finite");
  const Vector2d size = grid_.cell_size * Vector2d(grid_.columns, grid_.rows);
  if ((from - grid_.origin - size / 2).norm() > options_.max_range + size.norm()) return {};

  std::optional<RayScene> bodies;
  if (!objects.empty()) {
    std::vector<std::vector<Triangle>> triangles;
    for (std::size_t i = 0; i < objects.size(); ++i) {
      const HiddenObject& object = objects_[i];
      triangles.push_back(triangulate(
          object.shape, object_to_world(object.shape, object.anchor, objects[i]), objects[i].size));
    }
    bodies.emplace(triangles);
  }

  const double middle = heading(T_world_sensor);
  const Eigen::Rotation2Dd turn(heading(T_world_believed) - middle);
  const Vector2d believed = T_world_believed.translation().head<2>();
  // A cell of side h at distance d is at least h / d wide, as an angle.
  const double widest = grid_.cell_size / (options_.max_range + grid_.cell_size);
  const int directions = static_cast<int>(std::ceil(options_.field_of_view / widest));
  std::vector<std::uint8_t> marks(grid_.cells(), kNothing);
  LineOfSightScan scan;
  scan.objects_seen.assign(objects_.size(), false);
  for (int i = 0; i < directions; ++i) {
    const double angle = middle + options_.field_of_view * ((i + 0.5) / directions - 0.5);
    const Vector2d direction(std::cos(angle), std::sin(angle));
    const End end = nearest_end(from, direction, bodies ? &*bodies : nullptr);
    mark_free(grid_, believed, turn * direction, end.distance, marks);
    const Cell hit = grid_.cell_at(believed + turn * (end.hidden - from));
    if (end.mark == kNothing || !grid_.contains(hit)) continue;
    std::uint8_t& mark = marks[grid_.index(hit)];
    mark = std::max<std::uint8_t>(mark, end.mark);
    if (end.mark == kObject) scan.objects_seen[static_cast<std::size_t>(end.body)] = true;
  }
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if (marks[i] == kFree) scan.free.push_back(i);
    if (marks[i] == kSurface) scan.surface_hits.push_back(i);
    if (marks[i] == kObject) scan.object_hits.push_back(i);
  }
  return scan;
}

}  // namespace blindcorner
