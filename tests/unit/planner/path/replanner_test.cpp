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
  ReplannerTest() : replanner_(options(), replanner_options()) {
    map_.geometry = {.columns = 100, .rows = 50, .cell_size = 0.2};
    map_.occupancy.assign(map_.geometry.cells(), 0);
  }
  static PathPlannerOptions options() {
    PathPlannerOptions options;
    options.smoothing.footprint = VehicleFootprint::disc(0.3);
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
    return replanner_.update(grid, pose, speed, goal_, goal_heading_);
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

TEST_F(ReplannerTest, RefusesWhatACarCannotDrive) {
  PathPlannerOptions car = options();
  car.smoothing.min_turning_radius = 4;
  replanner_ = Replanner(car, replanner_options());
  goal_ = {6, 5};  // behind, and no room to turn
  const PlanUpdate behind = update({{10, 5}, 0}, 0);
  EXPECT_EQ(behind.action, PlanAction::stop);
  EXPECT_TRUE(behind.too_tight);
  EXPECT_EQ(behind.text().substr(0, 69),
            "stop: first_plan, the path found is tighter than the vehicle can turn");
  EXPECT_NE(behind.text().find("(curvature_exceeded"), std::string::npos);
  replanner_.reset();
  goal_ = {18, 5};
  EXPECT_EQ(update({{10, 5}, 0}, 0).action, PlanAction::replan);
  // What the vehicle can do counts, where it is known, not the radius of the plans.
  ReplannerOptions nimble = replanner_options();
  nimble.max_curvature = 1e9;
  replanner_ = Replanner(options(), nimble);
  goal_ = {10, 8};
  EXPECT_EQ(update({{10, 5}, 0}, 0).action, PlanAction::replan);
}

TEST_F(ReplannerTest, QuestionsATightPlanInEveryFrame) {
  PathPlannerOptions car = options();
  car.smoothing.min_turning_radius = 6;
  ReplannerOptions nimble = replanner_options();
  nimble.max_curvature = 2;
  nimble.refresh_after = 0;
  replanner_ = Replanner(car, nimble);
  fill(6.9, 7.5, 3, 12, 1);  // an arc that leads 2.3 m aside within 4.6 m has a radius of 4.6 m
  EXPECT_EQ(update({{2, 5}, 0}).text(), "replan: first_plan (curvature_exceeded)");
  EXPECT_EQ(update({{2, 5}, 0}).text(), "keep: new_plan_no_better (curvature_exceeded)");
  EXPECT_EQ(update({{2, 5}, 0}).text(), "keep: new_plan_no_better (curvature_exceeded)");
  map_.occupancy.assign(map_.geometry.cells(), 0);
  EXPECT_EQ(update({{2, 5}, 0}).text(), "replan: tight");
  EXPECT_EQ(update({{2, 5}, 0}).text(), "keep: still_good");
}

TEST_F(ReplannerTest, SeesObstaclesBetweenPoints) {
  PathPlannerOptions coarse = options();
  coarse.smoothing.point_spacing = 4;
  coarse.smoothing.min_turning_radius = 8;  // pieces of 2 m
  replanner_ = Replanner(coarse, replanner_options());
  const PlanUpdate first = update({{2, 5}, 0});
  double before = 0;  // the obstacle stands in the middle of the longest gap
  double gap = 0;
  for (std::size_t i = 1; i < first.path.points.size(); ++i) {
    const double a = first.path.points[i - 1].position.x();
    const double b = first.path.points[i].position.x();
    if (b - a > gap) gap = b - a, before = a;
  }
  ASSERT_GT(gap, 1.5);
  const double middle = before + gap / 2;
  fill(middle - 0.2, middle + 0.2, 4, 6, 1);
  EXPECT_EQ(update({{2, 5}, 0}).reason, PlanReason::blocked);
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
  EXPECT_THROW(Replanner(PathPlannerOptions{}, options), Error);
}

}  // namespace
}  // namespace blindcorner
