// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/replanner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

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
    return replanner_.update(grid, pose, speed, goal_);
  }

  TestMap map_;
  Replanner replanner_;
  Eigen::Vector2d goal_{18, 5};
};

TEST_F(ReplannerTest, KeepsAPlanThatIsGood) {
  EXPECT_EQ(update({{2, 5}, 0}).text(), "replan: first_plan");
  for (int frame = 1; frame <= 5; ++frame) {
    const PlanUpdate kept = update({{2 + 0.5 * frame, 5}, 0});
    EXPECT_EQ(kept.text(), "keep: still_good");
    EXPECT_NEAR(kept.arc_length, 0.5 * frame, 0.05);
  }
  EXPECT_EQ(update({{5, 5}, 0}).text(), "keep: new_plan_no_better");
  EXPECT_EQ(update({{17.95, 5}, 0}).text(), "keep: at_goal");
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
  ASSERT_EQ(stop.speed_limit.size(), stop.path.points.size());
  // v^2 / 2a = 16 / 8 = 2 m from where the vehicle is.
  EXPECT_NEAR(stop.path.points.back().arc_length - stop.arc_length, 2, 1e-9);
  EXPECT_EQ(stop.speed_limit.back(), 0);
  for (std::size_t i = 0; i < stop.speed_limit.size(); ++i) {
    const double rest = stop.path.points.back().arc_length - stop.path.points[i].arc_length;
    EXPECT_NEAR(stop.speed_limit[i], std::sqrt(8 * rest), 1e-9);
  }
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
  EXPECT_EQ(stop.speed_limit, std::vector<double>{0});
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
