// SPDX-License-Identifier: Apache-2.0
/// The published controller against closed forms: curves whose curvature is known, steering for a
/// known heading error, and a car on an empty map.
#include "blindcorner/planner/control/published_controller.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/planner/vehicles/car.h"
#include "blindcorner/planner/vehicles/vehicle.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

/// 40 m x 20 m, 0.25 m cells, lower corner (0, -10); a wall where asked.
PlanningGrid map_with(const std::function<bool(const Vector2d&)>& wall) {
  const GridGeometry geometry{160, 80, 0.25, {0, -10}};
  std::vector<double> occupancy(geometry.cells(), 0.0);
  for (std::size_t i = 0; i < occupancy.size(); ++i) {
    if (wall(geometry.center(geometry.cell(i)))) occupancy[i] = 1;
  }
  PlanningGridOptions options;
  options.lethal_radius = 1;
  options.risk_radius = 2.5;
  options.risk_weight = 10;
  return {geometry, occupancy, options};
}

PlanningGrid empty_map() {
  return map_with([](const Vector2d&) { return false; });
}

VehicleState at(double x, double y, double yaw = 0, double speed = 8) {
  VehicleState state;
  state.position = {x, y};
  state.yaw = yaw;
  state.speed = speed;
  return state;
}

/// Control points of a quarter of a circle of radius R: (0,0), (kR,0), (R,R-kR), (R,R) with
/// k = 4/3 (sqrt 2 - 1). Its curvature at the beginning is 2/3 (1 - k) / (k^2 R) = .979 / R, and
/// its middle is within 3e-4 R of the circle.
TEST(BezierCurve, HasTheCurvatureOfAQuarterCircle) {
  constexpr double kRadius = 15, k = 0.5522847498;
  BezierCurve curve;
  curve.control = {Vector2d(0, 0), Vector2d(k * kRadius, 0),
                   Vector2d(kRadius, kRadius - k * kRadius), Vector2d(kRadius, kRadius)};
  EXPECT_NEAR(curve.first_curvature(), 2.0 / 3.0 * (1 - k) / (k * k * kRadius), 1e-12);
  EXPECT_NEAR((curve.at(0.5) - Vector2d(0, kRadius)).norm(), kRadius, 3e-4 * kRadius);
  EXPECT_EQ(curve.at(0), curve.control[0]);
  EXPECT_EQ(curve.at(1), curve.control[3]);
  curve.control = {Vector2d(0, 0), Vector2d(1, 1), Vector2d(2, 2), Vector2d(3, 3)};
  EXPECT_NEAR(curve.first_curvature(), 0, 1e-12);
}

TEST(PublishedController, GoesStraightOnWithoutAPlan) {
  const PublishedController controller(make_car()->limits());
  const DriveRequest request = controller.follow(at(0, 0, 0.3, 6), 8);
  EXPECT_EQ(request.curvature, 0);
  EXPECT_DOUBLE_EQ(request.acceleration, PublishedControllerOptions{}.speed_gain * 2);
}

/// Along a row of cells the way is straight: the error alone steers, by gain * error / distance.
TEST(PublishedController, SteersInProportionToTheHeadingError) {
  PublishedController controller(make_car()->limits());
  ASSERT_EQ(controller.plan(empty_map(), at(5.125, 0.125), {{35.125, 0.125}, {}, {}}, 2),
            PathStatus::found);
  EXPECT_NEAR((controller.curve().control[1] - Vector2d(11.125, 0.125)).norm(), 0, 1e-9);
  EXPECT_NEAR(controller.follow(at(5.125, 0.125), 8).curvature, 0, 1e-9);
  const double gain = PublishedControllerOptions{}.steering_gain;
  EXPECT_NEAR(controller.follow(at(5.125, 0.125, 0.1), 8).curvature, -gain * 0.1 / 6, 1e-9);
  EXPECT_NEAR(controller.follow(at(5.125, 0.125, 2 * kPi - 0.1), 8).curvature, gain * 0.1 / 6,
              1e-9);
  EXPECT_NEAR(controller.follow(at(5.125, 0.125, -kPi / 2), 8).curvature,
              std::min(gain * kPi / 2 / 6, make_car()->limits().curvature), 1e-9);
}

TEST(PublishedController, SaysWhyThereIsNoWayAndKeepsTheLastCurve) {
  PublishedController controller(make_car()->limits());
  const PathGoal goal{{35.125, 0.125}, {}, {}};
  ASSERT_EQ(controller.plan(empty_map(), at(5.125, 0.125), goal, 2), PathStatus::found);
  const BezierCurve before = controller.curve();
  const PlanningGrid closed =
      map_with([](const Vector2d& p) { return std::abs(p.x() - 20) < 0.5; });
  EXPECT_EQ(controller.plan(closed, at(5.125, 0.125), goal, 2), PathStatus::no_path);
  EXPECT_EQ(controller.curve().control, before.control);
  const PlanningGrid full = map_with([](const Vector2d&) { return true; });
  EXPECT_EQ(controller.plan(full, at(5.125, 0.125), goal, 2), PathStatus::start_blocked);
}

/// A car that starts 1 m beside its way comes to a gap in a wall, at constant speed.
TEST(PublishedController, DrivesACarThroughAGap) {
  const PlanningGrid map = map_with(
      [](const Vector2d& p) { return std::abs(p.x() - 20) < 0.5 && std::abs(p.y() - 3) > 2.5; });
  Vehicle car(make_car());
  car.place(at(3, 0, 0, 6));
  PublishedController controller(car.model().limits());
  const PathGoal goal{{37, 3}, {}, {}};
  for (int step = 0; step < 300 && car.state().position.x() < 36; ++step) {
    if (step % 5 == 0) {
      ASSERT_EQ(controller.plan(map, car.state(), goal, 2), PathStatus::found);
    }
    car.step(controller.follow(car.state(), 6), 0.02);
    if (std::abs(car.state().position.x() - 20) < 0.5) {
      EXPECT_NEAR(car.state().position.y(), 3, 1.5);
    }
    EXPECT_NEAR(car.state().speed, 6, 0.3);
  }
  EXPECT_GT(car.state().position.x(), 36);
  EXPECT_NEAR(car.state().position.y(), 3, 1);
}

TEST(PublishedController, RefusesOptionsOutOfRange) {
  PublishedControllerOptions options;
  options.horizon = 0;
  EXPECT_THROW(PublishedController(make_car()->limits(), options), Error);
  options = {};
  options.feed_forward = -1;
  EXPECT_THROW(PublishedController(make_car()->limits(), options), Error);
}

}  // namespace
}  // namespace blindcorner
