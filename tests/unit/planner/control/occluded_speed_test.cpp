// SPDX-License-Identifier: Apache-2.0
// A car that goes along x past a wall with a gap, out of which somebody may come.
#include "blindcorner/planner/control/occluded_speed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "blindcorner/forward/error.h"
#include "test_paths.h"

namespace blindcorner {
namespace {

constexpr double kHardest = 8.8;  // m/s^2
constexpr double kWanted = 14;    // m/s

class Occluded : public ::testing::Test {
 protected:
  Occluded() {
    grid_.columns = 200;
    grid_.rows = 60;
    grid_.cell_size = 0.25;
    grid_.origin = {-5, -10};
  }
  /// A wall beside the way, 2.5 m from its middle, from `begin` to the corner at x = 20 m.
  Scene corner(double begin = -20) const {
    Scene scene;
    Surface wall;
    wall.name = "wall";
    wall.shape = BoxShape{{20 - begin, 5, 4}};
    wall.T_world_surface = Transform::Identity();
    wall.T_world_surface.translation() = Eigen::Vector3d((20 + begin) / 2, -5, 2);
    scene.surfaces.push_back(wall);
    return scene;
  }
  std::vector<Cell> wall_cells(double begin = -20) const {
    return grid_.cells_in({Eigen::Vector2d(begin, -7.5), Eigen::Vector2d(20, -2.5)});
  }
  /// Speeds of a car that has come from 10 m behind the origin, along its way.
  std::vector<double> limits(const Scene& scene, const std::vector<Cell>& walls,
                             const OccludedSpeedOptions& options) const {
    const LineOfSight sight(scene, grid_);
    Transform mount = Transform::Identity();
    mount.translation() = Eigen::Vector3d(2, 0, 1);
    OccludedSpeed occluded(sight, grid_, walls, body_, mount, options);
    for (double x = -3; x <= 0; x += 0.5) {
      VehicleState state;
      state.position = {x, 0};
      occluded.see(0.5 / kWanted, state);
    }
    return occluded.limits(straight_path(35, 0.5), 0, kWanted, kHardest);
  }
  static double least(const std::vector<double>& speeds) {
    return *std::ranges::min_element(speeds);
  }

  GridGeometry grid_;
  VehicleRectangle body_{4.5, 1.8, 0};
  OccludedSpeedOptions options_{.speed = 4};
};

TEST_F(Occluded, WhereNothingIsHiddenTheWantedSpeedStays) {
  Scene open;
  Surface far;
  far.shape = BoxShape{{1, 1, 1}};
  far.T_world_surface = Transform::Identity();
  far.T_world_surface.translation() = Eigen::Vector3d(500, 0, 0);
  open.surfaces.push_back(far);
  const auto speeds = limits(open, {}, options_);
  for (std::size_t i = 0; i < 20; ++i) EXPECT_GE(speeds[i], kWanted) << i;
}

TEST_F(Occluded, SlowsDownBeforeTheCornerAndNotBehindIt) {
  const auto speeds = limits(corner(), wall_cells(), options_);
  EXPECT_LT(least(speeds), 0.7 * kWanted);
  const auto slowest = std::ranges::min_element(speeds) - speeds.begin();
  // Its front, 2.25 m before its middle, is at the corner or up to a way to stop before it.
  EXPECT_GT(0.5 * static_cast<double>(slowest), 8);
  EXPECT_LE(0.5 * static_cast<double>(slowest), 20);
}

TEST_F(Occluded, TheFasterTheOthersTheSlowerTheVehicle) {
  double before = kWanted + 1;
  for (const double speed : {1.0, 3.0, 6.0}) {
    options_.speed = speed;
    const double now = least(limits(corner(), wall_cells(), options_));
    EXPECT_LT(now, before) << speed;
    before = now;
  }
  options_.speed = 0;  // who stands there does not stand on the way
  const auto speeds = limits(corner(), wall_cells(), options_);
  for (std::size_t i = 0; i < 20; ++i) EXPECT_GE(speeds[i], kWanted) << i;
}

// Somebody right behind the corner is as far from the car's swath as the wall: 2.5 m less its half
// width and margin; while he comes so far, the car must stop, or its front must be past.
TEST_F(Occluded, CanStopForWhoeverStartsBehindTheCorner) {
  const auto speeds = limits(corner(), wall_cells(), options_);
  const double comes = (2.5 - 0.9 - options_.side_margin) / options_.speed;
  for (std::size_t i = 0; i < 36; ++i) {
    const double front = 0.5 * static_cast<double>(i) + 2.25, before = 20 - front;
    const double v = std::min(speeds[i], kWanted);
    const double stops = v * options_.reaction_time + v * v / (2 * kHardest);
    const double there = before / std::max(v, 0.1);
    EXPECT_TRUE(before < 0 || stops <= before + 0.5 || there < comes + 1) << front << " " << v;
  }
}

TEST_F(Occluded, WrongOptionsAreNamed) {
  options_.speed = -1;
  try {
    limits(corner(), wall_cells(), options_);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("OccludedSpeedOptions.speed"), std::string::npos);
  }
}

}  // namespace
}  // namespace blindcorner
