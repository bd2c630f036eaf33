// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/predicted_contact.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "blindcorner/forward/error.h"
#include "blindcorner/planner/control/safe_speed.h"
#include "unit/planner/control/test_paths.h"

namespace blindcorner {
namespace {

constexpr double kPeriod = 0.05;  // s

/// 40 m by 40 m from (0, -5), occupied where a wall says so.
template <typename Wall>
PlanningGrid ground(const Wall& is_wall) {
  GridGeometry geometry{.columns = 400, .rows = 400, .cell_size = 0.1};
  geometry.origin = {0, -5};
  std::vector<double> occupancy;
  for (std::size_t i = 0; i < geometry.cells(); ++i) {
    const Eigen::Vector2d center = geometry.center(geometry.cell(i));
    occupancy.push_back(is_wall(center) ? 1 : 0);
  }
  return {geometry, occupancy};
}

/// From x on.
PlanningGrid wall_from(double x) {
  return ground([x](const Eigen::Vector2d& center) { return center.x() > x; });
}

Vehicle car_at(double x, double speed) {
  Vehicle car(make_vehicle_model("car"));
  car.place({.position = {x, 0}, .speed = speed});
  return car;
}

VehicleFootprint body_of(const Vehicle& vehicle) {
  const VehicleRectangle body = vehicle.model().footprint();
  return VehicleFootprint::rectangle(body.length, body.width, body.center_x);
}

/// Holds its speed, whatever the curve, also at the path's end.
PathFollower follower_at(const Vehicle& car, const std::vector<PathPoint>& path, double speed) {
  PathFollowerOptions options;
  options.profile.speed = options.profile.end = speed;
  options.profile.cornering = std::numeric_limits<double>::infinity();
  return {path, car.model().limits(), car.state(), options};
}

TEST(PredictedContact, OnAStraightPathItIsTheDistanceToTheWall) {
  const Vehicle car = car_at(5, 8);
  const PathFollower follower = follower_at(car, straight_path(39, 0.25), 8);
  const VehicleFootprint body = body_of(car);
  const double front = body.circumscribed_radius();  // the foremost disc's
  for (const double wall : {12.0, 15.0, 19.0}) {
    const auto contact = predicted_contact(car, follower, wall_from(wall), body);
    ASSERT_TRUE(contact) << wall;
    EXPECT_LE(*contact, wall - front + 0.1) << wall;  // the step before, where it was seen
    EXPECT_GE(*contact, wall - front - 8 * kPeriod - 0.1) << wall;
  }
  EXPECT_FALSE(predicted_contact(car, follower, wall_from(39), body));  // beyond the distance
  PredictionOptions far;
  far.distance = 35;
  EXPECT_TRUE(predicted_contact(car, follower, wall_from(39), body, far));
}

TEST(PredictedContact, WhoStopsBeforeTheWallDoesNotTouchIt) {
  const Vehicle car = car_at(5, 8);
  PathFollower follower = follower_at(car, straight_path(39, 0.25), 8);
  const PlanningGrid grid = wall_from(19);
  const auto contact = predicted_contact(car, follower, grid, body_of(car));
  ASSERT_TRUE(contact);
  std::vector<double> speeds(follower.path().size(), std::numeric_limits<double>::infinity());
  stop_at(follower.path(), *contact - 0.5, speeds);
  follower.limit_speed(speeds, car.state());
  EXPECT_FALSE(predicted_contact(car, follower, grid, body_of(car)));
}

// The path turns on 6 m, where friction allows 7.3 m/s, and the steering takes its time on top.
TEST(PredictedContact, AFreePathIsNotWhereTheVehicleGoes) {
  const auto path = turn_path(6, 20, std::numbers::pi / 2, 10, 0.25);
  const PlanningGrid grid = wall_from(26 + 2.5);
  for (const PathPoint& point : path) {
    const VehicleFootprint body = body_of(car_at(0, 1));
    ASSERT_TRUE(grid.is_free(body, {point.position, point.heading})) << point.arc_length;
  }
  const Vehicle fast = car_at(12, 9), slow = car_at(12, 3);
  EXPECT_FALSE(predicted_contact(slow, follower_at(slow, path, 3), grid, body_of(slow)));
  PathFollower follower = follower_at(fast, path, 9);
  PredictionOptions options;
  options.distance = 25;
  const auto contact = predicted_contact(fast, follower, grid, body_of(fast), options);
  ASSERT_TRUE(contact);
  Vehicle driven = fast;  // in steps of its own
  double touched = -1;
  for (double time = 0; time < 4 && touched < 0; time += 0.01) {
    const FollowerOutput output = follower.follow(driven.state());
    driven.step(output.request, 0.01);
    const VehicleState state = driven.state();
    if (!grid.is_free(body_of(driven), {state.position, state.yaw})) touched = output.arc_length;
  }
  EXPECT_NEAR(touched, *contact, 9 * kPeriod + 0.3);
}

TEST(PredictedContact, WhoOverlapsMayDriveOutButNotDeeper) {
  const Vehicle car = car_at(10, 2);
  const PathFollower follower = follower_at(car, straight_path(39, 0.25), 2);
  const double front = car.model().footprint().length / 2;
  const PlanningGrid behind =
      ground([&](const Eigen::Vector2d& center) { return center.x() < 10 - front + 0.3; });
  EXPECT_FALSE(predicted_contact(car, follower, behind, body_of(car)));
  const auto contact = predicted_contact(car, follower, wall_from(10 + front - 0.3), body_of(car));
  ASSERT_TRUE(contact);
  EXPECT_NEAR(*contact, 10, 0.2);
}

TEST(PredictedContact, AnOverlapBehindDoesNotHideAnObstacleAhead) {
  const Vehicle car = car_at(10, 2);
  const PathFollower follower = follower_at(car, straight_path(39, 0.25), 2);
  const double front = car.model().footprint().length / 2;
  const auto both = [&](double ahead) {
    return ground([=](const Eigen::Vector2d& center) {
      return center.x() < 10 - front + 0.5 || center.x() > 10 + ahead;
    });
  };
  EXPECT_TRUE(predicted_contact(car, follower, both(front + 1), body_of(car)));
  EXPECT_FALSE(predicted_contact(car, follower, both(front + 20), body_of(car)));
}

TEST(PredictedContact, OnlyWhoStaysWhereItStandsTouchesNothing) {
  const Vehicle car = car_at(10, 0);
  const auto path = straight_path(39, 0.25);
  const PlanningGrid grid = wall_from(15);
  EXPECT_FALSE(predicted_contact(car, follower_at(car, path, 0), grid, body_of(car)));
  EXPECT_TRUE(predicted_contact(car, follower_at(car, path, 5), grid, body_of(car)));
}

TEST(PredictedContact, RefusesOptionsThatAreNoNumbers) {
  const Vehicle car = car_at(10, 1);
  const PathFollower follower = follower_at(car, straight_path(39, 0.25), 1);
  for (const auto option :
       {&PredictionOptions::period, &PredictionOptions::distance, &PredictionOptions::time_limit}) {
    for (const double wrong : {0.0, -1.0, std::nan("")}) {
      PredictionOptions options;
      options.*option = wrong;
      EXPECT_THROW(predicted_contact(car, follower, wall_from(30), body_of(car), options), Error);
    }
  }
}

}  // namespace
}  // namespace blindcorner
