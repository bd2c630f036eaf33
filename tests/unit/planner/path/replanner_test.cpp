// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/replanner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string>

#include "blindcorner/forward/error.h"
#include "test_maps.h"

namespace blindcorner {
namespace {

/// A hall of 20 x 10 m with cells of 0.2 m, a round robot that goes from left to right.
class ReplannerTest : public ::testing::Test {
 protected:
  ReplannerTest() : replanner_(options(), options().footprint, replanner_options()) {
    map_.geometry = {.columns = 100, .rows = 50, .cell_size = 0.2};
    map_.occupancy.assign(map_.geometry.cells(), 0);
  }
  static PathPlannerOptions options() {
    PathPlannerOptions options;
    options.footprint = VehicleFootprint::disc(0.3);
    options.grid.risk_weight = 2;
    return options;
  }
  static ReplannerOptions replanner_options() {
    ReplannerOptions options;
    options.refresh_after = 5;
    return options;
  }
  void fill(double left, double right, double bottom, double top, double probability) {
    for (std::size_t i = 0; i < map_.geometry.cells(); ++i) {
      const Eigen::Vector2d at = map_.geometry.center(map_.geometry.cell(i));
      if (at.x() > left && at.x() < right && at.y() > bottom && at.y() < top) {
        map_.occupancy[i] = probability;
      }
    }
  }
  PlanUpdate update(const PlanarPose& pose, double speed = 1) {
    const PlanningGrid grid = replanner_.planner().grid(map_.geometry, map_.occupancy);
    return replanner_.update(grid, pose, speed, {goal_, goal_heading_, {}});
  }

  TestMap map_;
  Replanner replanner_;
  Eigen::Vector2d goal_{18, 5};
  std::optional<double> goal_heading_;
};

TEST_F(ReplannerTest, KeepsAPlanThatIsGood) {
  EXPECT_EQ(update({{2, 5}, 0}).text(), "replan: first_plan");
  for (int frame = 1; frame <= 5; ++frame) {
    const PlanUpdate kept = update({{2 + 0.5 * frame, 5}, 0});
    EXPECT_EQ(kept.text(), "keep: still_good");
    EXPECT_NEAR(kept.arc_length, 0.5 * frame, 0.05);
  }
  EXPECT_EQ(update({{5, 5}, 0}).text(), "keep: new_plan_no_better");
  EXPECT_EQ(update({{17.95, 5}, 0}, 0.5).text(), "stop: at_goal");
}

TEST_F(ReplannerTest, PlansAnewWhereTheWayIsBlocked) {
  update({{2, 5}, 0});
  fill(9, 11, 3, 7, 1);
  const PlanUpdate update_ = update({{3, 5}, 0});
  EXPECT_EQ(update_.text(), "replan: blocked");
  EXPECT_GT(update_.path.length, 15.1);
  EXPECT_EQ(update({{3, 5}, 0}).text(), "keep: still_good");
}

TEST_F(ReplannerTest, PlansAnewWhenTheWayBecomesRisky) {
  update({{2, 5}, 0});
  fill(9, 11, 3, 7, 0.6);
  EXPECT_EQ(update({{3, 5}, 0}).text(), "replan: costlier");
  replanner_.reset();
  map_.occupancy.assign(map_.geometry.cells(), 0);
  update({{2, 5}, 0});
  fill(-1, 30, -1, 30, 0.6);  // everywhere: no way is better
  EXPECT_EQ(update({{3, 5}, 0}).text(), "keep: new_plan_no_better");
  EXPECT_EQ(update({{3, 5}, 0}).text(), "keep: still_good");
}

TEST_F(ReplannerTest, PlansAnewOffThePathAndForAnotherGoal) {
  update({{2, 5}, 0});
  EXPECT_EQ(update({{3, 6}, 0}).text(), "replan: off_path");
  goal_ = {18, 8};
  EXPECT_EQ(update({{3, 6}, 0}).text(), "replan: goal_changed");
}

TEST_F(ReplannerTest, StandsWhereTheGoalIsPutAndForgetsTheOldOne) {
  update({{2, 5}, 0});
  goal_ = {5, 5};
  for (int frame = 0; frame < 3; ++frame) {
    const PlanUpdate stand = update({{5, 5}, 0}, 0);
    EXPECT_EQ(stand.text(), "stop: at_goal");
    ASSERT_EQ(stand.path.points.size(), 1U);
    EXPECT_EQ(stand.path.points[0].position, Eigen::Vector2d(5, 5));
  }
  const PlanUpdate back = update({{5.5, 5}, 0}, 0);  // pushed away
  EXPECT_EQ(back.text(), "replan: first_plan");
  EXPECT_EQ(back.path.points.back().position, goal_);
  EXPECT_TRUE(update({{5, 5}, 0}, 5).stops_too_late);
}

TEST_F(ReplannerTest, NoticesAGoalThatCreepsAndOneThatTurns) {
  update({{2, 5}, 0});
  const double first = goal_.y();
  int changed = 0;
  for (int frame = 1; frame <= 20; ++frame) {
    goal_.y() = first + 0.05 * frame;  // half the tolerance a frame
    const PlanUpdate now = update({{2, 5}, 0}, 0);
    changed += now.reason == PlanReason::goal_changed ? 1 : 0;
    EXPECT_LE((now.path.points.back().position - goal_).norm(), 0.1 + 1e-9) << frame;
  }
  EXPECT_GE(changed, 5);
  goal_heading_ = 1.0;
  EXPECT_EQ(update({{2, 5}, 0}).reason, PlanReason::goal_changed);
  EXPECT_EQ(update({{2, 5}, 0}).reason, PlanReason::still_good);
  goal_heading_ = 1.0 + 2 * std::numbers::pi;  // the same
  EXPECT_EQ(update({{2, 5}, 0}).reason, PlanReason::still_good);
  goal_heading_ = 1.2;
  EXPECT_EQ(update({{2, 5}, 0}).reason, PlanReason::goal_changed);
}

TEST_F(ReplannerTest, StopsWhereANumberIsNotFinite) {
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(update({{nothing, 5}, 0}).action, PlanAction::stop);  // without a plan
  EXPECT_EQ(update({{2, 5}, 0}).action, PlanAction::replan);
  const auto expect_stop = [&](const PlanUpdate& stop) {
    EXPECT_EQ(stop.action, PlanAction::stop);
    EXPECT_EQ(stop.reason, PlanReason::not_finite);
    EXPECT_EQ(stop.text().substr(0, 16), "stop: not_finite");
    ASSERT_FALSE(stop.path.points.empty());
    for (const PathPoint& point : stop.path.points) EXPECT_TRUE(point.position.allFinite());
    EXPECT_EQ(update({{2, 5}, 0}).text(), "replan: stopped");  // afterwards as ever
  };
  expect_stop(update({{2, nothing}, 0}));
  expect_stop(update({{2, 5}, nothing}));
  const PlanUpdate unknown_speed = update({{2, 5}, 0}, nothing);
  EXPECT_TRUE(unknown_speed.stops_too_late);
  expect_stop(unknown_speed);
  const Eigen::Vector2d goal = goal_;
  goal_.x() = std::numeric_limits<double>::infinity();
  const PlanUpdate no_goal = update({{2, 5}, 0});
  goal_ = goal;
  expect_stop(no_goal);
  goal_heading_ = nothing;
  const PlanUpdate no_heading = update({{2, 5}, 0});
  goal_heading_.reset();
  expect_stop(no_heading);
}

/// A car that turns in 4 m, in the hall.
PathPlannerOptions car_options() {
  PathPlannerOptions car;
  car.footprint = VehicleFootprint::rectangle(2, 0.8);
  car.curves.turning_radius = 4;
  car.grid.risk_weight = 2;
  return car;
}

TEST_F(ReplannerTest, FollowsNothingThatACarCannotDrive) {
  replanner_ = Replanner(car_options(), car_options().footprint, replanner_options());
  fill(-1, 21, 8, 11, 1);
  fill(-1, 21, -1, 2, 1);
  goal_ = {6, 5};  // behind, and no room to turn
  const PlanUpdate behind = update({{10, 5}, 0}, 0);
  EXPECT_EQ(behind.text(), "stop: first_plan, no_path");
  goal_ = {18, 5};
  const PlanUpdate ahead = update({{10, 5}, 0}, 0);
  EXPECT_EQ(ahead.text(), "replan: stopped");
  EXPECT_LE(ahead.path.greatest_curvature(), 1.03 / 4);
}

TEST_F(ReplannerTest, GoesOnWithItsPlanWhereThereIsNoBetterOne) {
  replanner_ = Replanner(car_options(), car_options().footprint, replanner_options());
  const PlanUpdate first = update({{2, 5}, 0});
  fill(9, 11, 3, 7, 0.6);  // riskier, and open
  fill(9, 11, 7, 11, 1);
  fill(9, 11, -1, 3, 1);
  const PlanUpdate kept = update({{3, 5}, 0});
  EXPECT_EQ(kept.text(), "keep: new_plan_no_better");
  EXPECT_EQ(kept.path.length, first.path.length);
}

TEST_F(ReplannerTest, KeepsAPlanUntilTheBodyItselfWouldTouch) {
  PathPlannerOptions wide = car_options();
  wide.footprint = VehicleFootprint::rectangle(2.4, 1.2);
  wide.grid.risk_weight = 0;
  replanner_ = Replanner(wide, VehicleFootprint::rectangle(2, 0.8), replanner_options());
  update({{2, 5}, 0});
  fill(9, 9.3, 5.5, 7, 1);  // within the room beside the body, 0.1 m from the body
  EXPECT_NE(update({{2, 5}, 0}).reason, PlanReason::blocked);
  fill(9, 9.3, 5.3, 7, 1);
  EXPECT_EQ(update({{2, 5}, 0}).reason, PlanReason::blocked);
}

TEST_F(ReplannerTest, SeesObstaclesBetweenPoints) {
  PathPlannerOptions coarse = car_options();
  coarse.point_spacing = 4;
  replanner_ = Replanner(coarse, coarse.footprint, replanner_options());
  const PlanUpdate first = update({{2, 5}, 0});
  ASSERT_GT(first.path.points[1].arc_length, 2.5);
  const double middle = (first.path.points[1].position.x() + first.path.points[2].position.x()) / 2;
  fill(middle - 0.2, middle + 0.2, 4, 6, 1);
  EXPECT_EQ(update({{2, 5}, 0}).reason, PlanReason::blocked);
}

TEST_F(ReplannerTest, LeavesWhatItStandsIn) {
  replanner_ = Replanner(car_options(), car_options().footprint, replanner_options());
  fill(1, 2.4, 5.2, 7, 1);  // reaches 0.2 m into the car's side, behind its middle
  const PlanUpdate away = update({{3, 5}, 0}, 0);
  EXPECT_EQ(away.text(), "replan: first_plan");
  EXPECT_EQ(update({{3, 5}, 0}, 0).text(), "keep: still_good");
}

TEST_F(ReplannerTest, DrivesToALine) {
  replanner_ = Replanner(car_options(), car_options().footprint, replanner_options());
  const PathGoal line{{18, 2}, {}, Eigen::Vector2d(18, 8)};
  const PlanningGrid grid = replanner_.planner().grid(map_.geometry, map_.occupancy);
  const PlanUpdate first = replanner_.update(grid, {{2, 3}, 0.2}, 1, line);
  ASSERT_EQ(first.action, PlanAction::replan);
  EXPECT_NEAR(first.path.points.back().position.x(), 18, 0.05);
  EXPECT_GT(first.path.points.back().position.y(), 2);
  EXPECT_LT(first.path.points.back().position.y(), 8);
}

// The car goes at 4 m/s; who comes from the side will be on its way in 2 s.
TEST_F(ReplannerTest, GoesAroundWhereSomebodyWillBe) {
  replanner_ = Replanner(car_options(), car_options().footprint, replanner_options());
  const PathGoal line{{18, 0}, {}, Eigen::Vector2d(18, 10)};
  const PlanningGrid grid = replanner_.planner().grid(map_.geometry, map_.occupancy);
  const PlanarPose start{{2, 5}, 0};
  replanner_.update(grid, start, 4, line);
  Mover mover;
  mover.body = VehicleFootprint::rectangle(1, 0.6);
  mover.pose = {{10, 1}, 1.57};
  mover.velocity = {0, 2};
  const PlanUpdate around = replanner_.update(grid, start, 4, line, 0, {&mover, 1});
  EXPECT_EQ(around.text(), "replan: crossed");
  const MoverAvoidance avoidance{{&mover, 1}, 4};
  for (double s = 0; s <= around.path.length; s += 0.2) {
    const PathPoint place = around.path.at(s);
    ASSERT_FALSE(
        avoidance.meets(car_options().footprint, {place.position, place.heading}, s, start));
  }
  // Where there is no way around, the way is kept: it is for braking.
  mover.body = VehicleFootprint::rectangle(30, 1);
  mover.pose = {{10, -5}, 1.57};
  EXPECT_EQ(replanner_.update(grid, start, 4, line, 0, {&mover, 1}).text(),
            "keep: new_plan_no_better");
}

TEST_F(ReplannerTest, SeesWhatHasBecomeFree) {
  fill(9, 11, 0, 8, 1);
  const double round = update({{2, 5}, 0}).path.length;
  map_.occupancy.assign(map_.geometry.cells(), 0);
  PlanUpdate last;
  for (int frame = 0; frame < 6; ++frame) last = update({{2, 5}, 0});
  EXPECT_EQ(last.text(), "replan: refresh");
  EXPECT_LT(last.path.length, round - 0.5);
}

TEST_F(ReplannerTest, StopsSafelyWhereThereIsNoWay) {
  update({{2, 5}, 0});
  fill(9, 10, -1, 11, 1);
  const PlanUpdate stop = update({{3, 5}, 0}, 4);
  EXPECT_EQ(stop.action, PlanAction::stop);
  EXPECT_EQ(stop.text(), "stop: blocked, no_path");
  EXPECT_FALSE(stop.stops_too_late);
  // v^2 / 2a = 16 / 8 = 2 m from where the vehicle is.
  EXPECT_NEAR(stop.path.points.back().arc_length - stop.arc_length, 2, 1e-9);
  EXPECT_EQ(update({{4, 5}, 0}, 2).text(), "stop: stopped, no_path");
  map_.occupancy.assign(map_.geometry.cells(), 0);
  EXPECT_EQ(update({{4.5, 5}, 0}, 0).text(), "replan: stopped");
}

TEST_F(ReplannerTest, StopEndsBeforeTheObstacleAndSaysWhenThatIsTooLate) {
  update({{2, 5}, 0});
  fill(9, 10, -1, 11, 1);
  const PlanUpdate stop = update({{5, 5}, 0}, 10);  // would need 12.5 m
  EXPECT_TRUE(stop.stops_too_late);
  const double end = stop.path.points.back().position.x();
  EXPECT_LE(end, 9 - 0.3 - 0.5 + 0.11);  // radius, margin, a point's spacing
  EXPECT_GE(end, 9 - 0.3 - 0.5 - 0.11);
}

TEST_F(ReplannerTest, StopsOnTheSpotWithoutAnyPlan) {
  fill(9, 10, -1, 11, 1);
  const PlanUpdate stop = update({{3, 5}, 0.4}, 0);
  EXPECT_EQ(stop.text(), "stop: first_plan, no_path");
  ASSERT_EQ(stop.path.points.size(), 1U);
  EXPECT_EQ(stop.path.points[0].position, Eigen::Vector2d(3, 5));
  EXPECT_FALSE(stop.stops_too_late);
  replanner_.reset();
  EXPECT_TRUE(update({{3, 5}, 0.4}, 5).stops_too_late);
  replanner_.reset();
  EXPECT_EQ(update({{9.5, 5}, 0}, 0).text(), "stop: first_plan, start_blocked");
}

TEST_F(ReplannerTest, TellsTimesAndRefusesNonsense) {
  EXPECT_GT(update({{2, 5}, 0}).time, 0);
  ReplannerOptions options;
  options.deceleration = 0;
  EXPECT_THROW(Replanner(PathPlannerOptions{}, {}, options), Error);
}

}  // namespace
}  // namespace blindcorner
