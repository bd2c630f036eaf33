// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/true_world.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "blindcorner/forward/scene/footprint.h"
#include "blindcorner/simulation/synthetic.h"
#include "simulation/convex_distance.h"

namespace blindcorner {
namespace {

/// Surfaces that end below this height are driven over: the road, m.
constexpr double kKerb = 0.05;
/// Whether there is an object at all is drawn from another sequence than where it is.
constexpr std::uint64_t kPresenceSeed = 0xd6e8feb86659fd93;

bool in_the_way(const Surface& surface, double vehicle_height) {
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  for (const Triangle& triangle : triangulate(surface.shape, surface.T_world_surface, 1.0)) {
    for (const Eigen::Vector3d& corner : triangle) {
      lowest = std::min(lowest, corner.z());
      highest = std::max(highest, corner.z());
    }
  }
  return highest > kKerb && lowest < vehicle_height;
}

double drawn(double lower, double upper, std::mt19937_64& random) {
  return lower < upper ? std::uniform_real_distribution<double>(lower, upper)(random) : lower;
}

}  // namespace

TrueWorld::TrueWorld(const Drive& drive, std::uint64_t seed, std::optional<double> speed)
    : drive_(drive) {
  std::mt19937_64 random(seed);
  start_ = draw_pose(drive.scene, random);
  for (std::size_t i = 0; i < drive.truth.components.size(); ++i) {
    const auto& component = drive.truth.components[i];
    if (!component) continue;
    start_[static_cast<Eigen::Index>(i)] = drawn(component->lower, component->upper, random);
  }
  speed_ = drawn(drive.speed_lower, drive.speed_upper, random);
  velocity_ = drive.truth.velocity;
  for (std::size_t i = 0; i < drive.truth.velocity_upper.size(); ++i) {
    for (const Eigen::Index axis : {0, 1}) {
      velocity_[i][axis] = drawn(velocity_[i][axis], drive.truth.velocity_upper[i][axis], random);
    }
  }
  // Drawn in any case, so that the rest of the world is the same with and without an error.
  std::normal_distribution<double> normal;
  for (double& offset : offset_) offset = drive.vehicle.localization_sigma * normal(random);
  turn_ = drive.vehicle.localization_yaw_sigma * normal(random);
  if (speed) speed_ = *speed;
  if (const auto& meeting = drive.truth.meeting) {
    const Eigen::Vector2d way = velocity_.front().normalized();
    const Eigen::Vector2d start =
        meeting->point - meeting->time * velocity_.front() + meeting->spread * normal(random) * way;
    for (std::size_t i = 0; i < drive.scene.unknowns.size(); ++i) {
      const Unknown& unknown = drive.scene.unknowns[i];
      const auto axis = static_cast<Eigen::Index>(unknown.component);
      if (unknown.object == 0 && axis <= 1) start_[static_cast<Eigen::Index>(i)] = start[axis];
    }
  }
  std::mt19937_64 presence(seed ^ kPresenceSeed);
  present_ = std::uniform_real_distribution<double>(0, 1)(presence) < drive.truth.present;
  for (const Surface& surface : drive.scene.surfaces) {
    if (!in_the_way(surface, drive.vehicle.height)) continue;
    walls_.push_back(footprint(surface.shape, surface.T_world_surface));
    wall_names_.push_back(surface.name);
  }
}

/// The start that the drive states. Before a meeting: as far before its point, along the vehicle's
/// heading, as the vehicle goes until then.
Eigen::Vector2d TrueWorld::vehicle_start() const {
  const DriveVehicle& vehicle = drive_.vehicle;
  const auto& meeting = drive_.truth.meeting;
  if (!meeting) return vehicle.start;
  const Eigen::Vector2d ahead(std::cos(vehicle.start_yaw), std::sin(vehicle.start_yaw));
  const double way = ahead.dot(meeting->point - vehicle.start) - meeting->time * speed_;
  return vehicle.start + way * ahead;
}

std::vector<Cell> TrueWorld::wall_cells() const {
  const GridGeometry& map = drive_.map;
  const double reach = map.cell_size * std::sqrt(0.5);
  std::vector<Cell> cells;
  std::vector<bool> found(map.cells());
  for (const auto& wall : walls_) {
    Eigen::AlignedBox2d box;
    for (const Eigen::Vector2d& corner : wall) box.extend(corner);
    const Eigen::Vector2d margin = Eigen::Vector2d::Constant(reach);
    for (const Cell& cell : map.cells_in({box.min() - margin, box.max() + margin})) {
      if (found[map.index(cell)] || convex_distance({map.center(cell)}, wall) > reach) continue;
      found[map.index(cell)] = true;
      cells.push_back(cell);
    }
  }
  return cells;
}

std::optional<PoseVector> TrueWorld::hidden(double time) const {
  if (!present_) return std::nullopt;
  const auto& turn = drive_.truth.turn;
  const double after = turn ? std::max(0.0, time - turn->time) : 0.0;
  PoseVector pose = start_;
  for (std::size_t i = 0; i < drive_.scene.unknowns.size(); ++i) {
    const Unknown& unknown = drive_.scene.unknowns[i];
    const auto axis = static_cast<Eigen::Index>(unknown.component);
    if (axis > 1) continue;
    const auto object = static_cast<std::size_t>(unknown.object);
    double& value = pose[static_cast<Eigen::Index>(i)];
    value += velocity_[object][axis] * (time - after);
    if (turn) value += turn->velocity[object][axis] * after;
  }
  return pose;
}

VehicleState TrueWorld::believed(const VehicleState& truth) const {
  VehicleState state = truth;
  state.position += offset_;
  state.yaw += turn_;
  return state;
}

std::optional<PoseVector> TrueWorld::believed_hidden(const VehicleState& truth, double time) const {
  std::optional<PoseVector> pose = hidden(time);
  if (!pose) return pose;
  const std::vector<Placement> placements = placements_at(drive_.scene, *pose);
  for (std::size_t i = 0; i < drive_.scene.unknowns.size(); ++i) {
    const Unknown& unknown = drive_.scene.unknowns[i];
    double& value = (*pose)[static_cast<Eigen::Index>(i)];
    if (unknown.component == Component::yaw) value += turn_;
    const auto axis = static_cast<Eigen::Index>(unknown.component);
    if (axis > 1) continue;
    const auto& place = placements[static_cast<std::size_t>(unknown.object)].position;
    const Eigen::Vector2d seen = Eigen::Rotation2Dd(turn_) * (place.head<2>() - truth.position);
    value = (truth.position + offset_ + seen)[axis];
  }
  return pose;
}

std::vector<Placement> TrueWorld::placements(double time) const {
  const std::optional<PoseVector> pose = hidden(time);
  return pose ? placements_at(drive_.scene, *pose) : std::vector<Placement>{};
}

std::vector<std::vector<Eigen::Vector2d>> TrueWorld::bodies(double time) const {
  std::vector<std::vector<Eigen::Vector2d>> outlines;
  for (const Placement& placement : placements(time)) {
    const HiddenObject& object = hidden_object(drive_.scene, static_cast<int>(outlines.size()));
    outlines.push_back(footprint(object.shape, object.anchor, placement));
  }
  return outlines;
}

double TrueWorld::clearance(const std::vector<Eigen::Vector2d>& outline, double time) const {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& wall : walls_) least = std::min(least, convex_distance(outline, wall));
  for (const auto& body : bodies(time)) least = std::min(least, convex_distance(outline, body));
  return least;
}

std::string TrueWorld::touched(const std::vector<Eigen::Vector2d>& outline, double time) const {
  const auto touches = [&outline](const std::vector<Eigen::Vector2d>& other) {
    return convex_distance(outline, other) <= 0;
  };
  const auto there = bodies(time);
  if (const auto body = std::ranges::find_if(there, touches); body != there.end()) {
    return hidden_object(drive_.scene, static_cast<int>(body - there.begin())).name;
  }
  const auto wall = std::ranges::find_if(walls_, touches);
  return wall == walls_.end() ? "" : wall_names_[static_cast<std::size_t>(wall - walls_.begin())];
}

}  // namespace blindcorner
