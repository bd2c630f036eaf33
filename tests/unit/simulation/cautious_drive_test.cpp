// SPDX-License-Identifier: Apache-2.0
// Drives over the crossing: of one who expects somebody wherever it does not see, and of one who is
// told the truth where something is wrong with frames, map or road.
#include <gtest/gtest.h>

#include <algorithm>

#include "blindcorner/simulation/drive_loop.h"
#include "bundled.h"

namespace blindcorner {
namespace {

DriveResult run(const Drive& drive, const std::string& perception, double speed) {
  static const SimulatedSensor sensor(drive.scene);
  DriveOptions options;
  options.perception = perception;
  options.seed = 3;
  options.speed = speed;
  options.keep_pictures = false;
  return drive_through(drive, sensor, options);
}

Drive crossing(double present) {
  Drive drive = bundled_drive("crossing_cyclist");
  drive.truth.present = present;
  return drive;
}

TEST(CautiousDrive, SlowsDownForWhoMayComeAndDrivesOn) {
  const Drive empty = crossing(0);
  const DriveResult cautious = run(empty, "los_cautious", 10), los = run(empty, "los", 10);
  EXPECT_EQ(cautious.outcome, DriveOutcome::reached);
  EXPECT_NEAR(los.mean_speed, 10, 0.1);
  EXPECT_LT(cautious.mean_speed, 9);
  EXPECT_GT(cautious.mean_speed, 5);
  const auto slowest = std::ranges::min_element(
      cautious.frames, {}, [](const DriveFrame& frame) { return frame.vehicle.speed; });
  EXPECT_LT(slowest->vehicle.position.x(), -5.5) << "before the corner";
}

TEST(CautiousDrive, StopsForWhoComesWhereDirectSightAloneIsTooLate) {
  Drive drive = crossing(1);
  drive.truth.velocity = {{0, 5.6}};
  drive.truth.velocity_upper.clear();
  drive.truth.meeting->spread = 0;
  EXPECT_EQ(run(drive, "los", 15).outcome, DriveOutcome::collision);
  EXPECT_EQ(run(drive, "los_cautious", 15).outcome, DriveOutcome::reached);
}

// Nobody knows a velocity at the first frame that shows him: he may move.
TEST(CautiousDrive, BrakesInTheFrameThatFirstShowsWhoComes) {
  Drive drive = crossing(1);
  drive.truth.velocity = {{0, 4.2}};
  drive.truth.velocity_upper.clear();
  drive.truth.meeting->spread = 0;
  const DriveResult result = run(drive, "los", 13);
  const auto seen = std::ranges::find(result.frames, FrameFate::in_sight, &DriveFrame::fate);
  ASSERT_NE(seen, result.frames.end());
  EXPECT_EQ(seen->braking_for, drive.scene.hidden.name);
  EXPECT_GT(seen->braking, 3);
}

// Nobody moves: what is seen stays empty, and nobody stands on the lane.
TEST(CautiousDrive, WhereNobodyMovesNothingIsLost) {
  Drive drive = crossing(0);
  drive.truth.velocity = {Eigen::Vector2d::Zero()};
  drive.truth.velocity_upper.clear();
  EXPECT_NEAR(run(drive, "los_cautious", 10).mean_speed, 10, 0.2);
}

class CrossingFaults : public ::testing::TestWithParam<double> {
 protected:
  CrossingFaults() : drive_(crossing(1)) {}
  void expect_reached() {
    EXPECT_EQ(run(drive_, "oracle", GetParam()).outcome, DriveOutcome::reached);
  }
  Drive drive_;
};

TEST_P(CrossingFaults, EveryThirdFrameIsMissing) {
  drive_.sensor.missing_share = 0.33;
  expect_reached();
}

TEST_P(CrossingFaults, EveryThirdFrameIsLate) {
  drive_.sensor.late_share = 0.33;
  drive_.sensor.late_by = 0.2;
  expect_reached();
}

TEST_P(CrossingFaults, TheMapIsOffByTenCentimetresAndADegree) {
  drive_.vehicle.localization_sigma = 0.1;
  drive_.vehicle.localization_yaw_sigma = 0.01745;
  expect_reached();
}

TEST_P(CrossingFaults, TheRoadIsSlippery) {
  drive_.vehicle.friction = 0.3;
  expect_reached();
}

// He stands on the walk, and who has seen him move drives on when he does not.
TEST_P(CrossingFaults, TheCyclistStopsBeforeTheLane) {
  drive_.truth.turn = DriveTurn{.time = 2, .velocity = {Eigen::Vector2d::Zero()}};
  expect_reached();
}

TEST_P(CrossingFaults, TheCyclistTurnsBack) {
  drive_.truth.turn = DriveTurn{.time = 2.5, .velocity = {Eigen::Vector2d(0, -4)}};
  expect_reached();
}

// There is no other way: the car stands before him.
TEST_P(CrossingFaults, TheCyclistStopsInTheLane) {
  drive_.truth.meeting->spread = 0;
  drive_.truth.turn = DriveTurn{.time = 3.5, .velocity = {Eigen::Vector2d::Zero()}};
  const DriveResult result = run(drive_, "oracle", GetParam());
  EXPECT_EQ(result.outcome, DriveOutcome::stopped);
  EXPECT_GT(result.clearance, 0);
}

// The second comes 1.5 s after the first, or from the other side.
TEST_P(CrossingFaults, TwoCross) {
  for (const bool behind : {true, false}) {
    Drive drive = drive_;
    Scene& scene = drive.scene;
    HiddenObject second = scene.hidden;
    second.name = "second";
    scene.further_hidden.push_back(second);
    const std::vector<Unknown> first = scene.unknowns;
    for (Unknown unknown : first) {
      unknown.object = 1;
      if (unknown.component == Component::y) {
        unknown.lower = -40;
        unknown.upper = 40;
      }
      scene.unknowns.push_back(unknown);
    }
    drive.truth.velocity = {{0, 4}, {0, behind ? 4 : -4}};
    drive.truth.velocity_upper.clear();
    drive.truth.meeting->spread = 0;
    const auto at = [](double value) { return TrueComponent{value, value}; };
    const double way = 4 * 3.5;
    drive.truth.components.resize(scene.unknowns.size());
    drive.truth.components[3] = at(behind ? -4.25 : 1.5);
    drive.truth.components[4] = at(behind ? -1.5 - way - 6 : -1.5 + way);
    drive.truth.components[5] = at(1.5708);
    const SimulatedSensor sensor(drive.scene);
    DriveOptions options;
    options.perception = "oracle";
    options.speed = GetParam();
    options.keep_pictures = false;
    EXPECT_EQ(drive_through(drive, sensor, options).outcome, DriveOutcome::reached) << behind;
  }
}

INSTANTIATE_TEST_SUITE_P(Speeds, CrossingFaults, ::testing::Values(6.0, 10.0));

}  // namespace
}  // namespace blindcorner
