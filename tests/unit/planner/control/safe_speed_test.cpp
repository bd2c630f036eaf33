// SPDX-License-Identifier: Apache-2.0
// Speeds from which a vehicle can stop, against their closed forms; what it touches and sees along
// a path.
#include "blindcorner/planner/control/safe_speed.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "blindcorner/forward/error.h"
#include "blindcorner/planner/control/path_follower.h"
#include "blindcorner/planner/control/path_outlook.h"
#include "blindcorner/planner/grid/pose_spread.h"
#include "unit/planner/control/test_paths.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

VehicleLimits car() {
  VehicleLimits limits;
  limits.speed = 50;
  limits.acceleration = 4;
  limits.friction = 8;
  return limits;
}

/// Braking 4 m/s^2, reaction 0.5 s, nothing disregarded, no margin.
SafeSpeedOptions plain() {
  SafeSpeedOptions options;
  options.risk = 0;
  options.reaction_time = 0.5;
  options.braking = 0.5;
  options.margin = 0;
  return options;
}

double closed_form(double distance, double braking, double reaction_time) {
  const double b = braking * reaction_time;
  return std::sqrt(2 * braking * distance + b * b) - b;
}

double limit_at(const std::vector<Encounter>& encounters, double from,
                const SafeSpeedOptions& options = plain()) {
  const auto path = straight_path(100, 0.5);
  const auto speeds = safe_speed_limits(path, car(), encounters, from, options);
  return speeds[static_cast<std::size_t>(std::lround(from / 0.5))];
}

TEST(SafeSpeed, NothingUnknownAsksForNothing) {
  const auto speeds = safe_speed_limits(straight_path(50, 0.5), car(), {}, 0, plain());
  for (const double speed : speeds) EXPECT_EQ(speed, kNever);
  EXPECT_TRUE(safe_speed_limits({}, car(), {}, 0, plain()).empty());
}

TEST(SafeSpeed, AStopIsOneAlsoForWhoOvershootsIt) {
  const auto path = straight_path(10, 0.5);
  std::vector<double> speeds(path.size(), kNever);
  stop_at(path, 4.2, speeds);
  for (std::size_t i = 0; i < path.size(); ++i) {
    EXPECT_EQ(speeds[i], path[i].arc_length < 4 ? kNever : 0) << path[i].arc_length;
  }
  std::ranges::fill(speeds, kNever);
  stop_at(path, 99, speeds);
  EXPECT_EQ(speeds.back(), 0);
  EXPECT_EQ(speeds[speeds.size() - 2], kNever);
  stop_at({}, 1, {});
  EXPECT_THROW(stop_at(path, 1, {}), Error);
  EXPECT_THROW(stop_at(path, std::nan(""), speeds), Error);
}

TEST(SafeSpeed, BeforeAWallOfTheUnknownItIsTheClosedForm) {
  for (const double distance : {1.0, 5.0, 20.0, 60.0}) {
    // In sight only here: everything beyond is hidden from anywhere nearer.
    const std::vector<Encounter> wall{{1, 10 + distance, 10}};
    EXPECT_NEAR(limit_at(wall, 10), closed_form(distance, 4, 0.5), 1e-3) << distance;
  }
  SafeSpeedOptions with_margin = plain();
  with_margin.margin = 2;
  EXPECT_NEAR(limit_at({{1, 30, 10}}, 10, with_margin), closed_form(18, 4, 0.5), 1e-3);
}

TEST(SafeSpeed, WhatIsCertainAndNeverSeenIsStoppedFor) {
  const auto path = straight_path(100, 0.5);
  const auto limits =
      safe_speed_limits(path, car(), std::vector<Encounter>{{1, 40, kNever}}, 0, plain());
  EXPECT_EQ(limits[80], 0);       // at 40 m
  EXPECT_EQ(limits[40], kNever);  // before it braking is the profile's matter
  SpeedProfileOptions options;
  options.speed = options.start = options.end = 10;
  options.limits = limits;
  const auto profile = speed_profile(path, car(), options);
  EXPECT_EQ(profile[80], 0);
  EXPECT_NEAR(profile[70], std::sqrt(2 * 4 * 5.0), 1e-9);  // 5 m before, with 4 m/s^2
}

TEST(SafeSpeed, WhatWillBeSeenInTimeCostsNothingNow) {
  // Seen from 30 m on, touched at 45: now, at 0, nothing; at 30 the closed form of 15 m.
  const std::vector<Encounter> later{{1, 45, 30}};
  EXPECT_EQ(limit_at(later, 0), kNever);
  EXPECT_NEAR(limit_at(later, 30), closed_form(15, 4, 0.5), 1e-3);
  // What was touched would be behind.
  EXPECT_EQ(limit_at({{1, 20, 0}}, 30), kNever);
}

TEST(SafeSpeed, WhatComesTowardsItTakesDistance) {
  SafeSpeedOptions options = plain();
  options.closing_speed = 3;
  // v t + v^2 / 2b + u (t + v / b) = 30 with b = 4, t = 0.5: v^2 / 8 + 1.25 v - 28.5 = 0.
  const double v = 4 * (-1.25 + std::sqrt(1.25 * 1.25 + 28.5 / 2));
  const auto path = straight_path(100, 0.5);
  const std::vector<Encounter> hidden{{1, 50, 20}};
  EXPECT_NEAR(safe_speed_limits(path, car(), hidden, 0, options)[40], v, 0.01);
  // In sight already: whether it moves is seen.
  EXPECT_NEAR(limit_at(hidden, 20, options), closed_form(30, 4, 0.5), 1e-3);
}

TEST(SafeSpeed, RisesWithTheRiskAndWithDistance) {
  const std::vector<Encounter> many{{0.002, 13, 10}, {0.003, 16, 10}, {0.1, 25, 10}};
  double last = 0;
  for (const double risk : {0.0, 0.001, 0.002, 0.004, 0.005, 0.05, 0.2}) {
    SafeSpeedOptions options = plain();
    options.risk = risk;
    const double speed = limit_at(many, 10, options);
    EXPECT_GE(speed, last) << risk;
    last = speed;
  }
  SafeSpeedOptions options = plain();
  options.risk = 0.0051;  // two of them, together
  EXPECT_NEAR(limit_at(many, 10, options), closed_form(15, 4, 0.5), 1e-3);
  EXPECT_EQ(last, kNever);
}

TEST(SafeSpeed, OneObjectAtManyPlacesIsOneRisk) {
  // A tenth of a thousandth at each of forty places: 0.004 in all, however many cells they fill.
  std::vector<Encounter> places;
  for (int i = 0; i < 40; ++i) places.push_back({1e-4, 20 + 0.1 * i, 10});
  SafeSpeedOptions options = plain();
  options.risk = 0.005;
  EXPECT_EQ(limit_at(places, 10, options), kNever);
  options.risk = 0.003;
  EXPECT_LT(limit_at(places, 10, options), closed_form(4 + 10, 4, 0.5));
}

TEST(SafeSpeed, CurvesLeaveLessToBrakeWith) {
  const auto turn = turn_path(20, 10, std::numbers::pi / 2, 10, 0.25);
  const std::vector<Encounter> wall{{1, 30, 12}};
  const double on_turn = safe_speed_limits(turn, car(), wall, 12, plain())[48];
  EXPECT_LT(on_turn, closed_form(18, 4, 0.5));
  EXPECT_GT(on_turn, 0.7 * closed_form(18, 4, 0.5));
}

TEST(SafeSpeed, RefusesWhatIsNotANumber) {
  const auto path = straight_path(10, 0.5);
  const double nan = std::nan("");
  for (const Encounter& bad :
       {Encounter{nan, 1, 0}, Encounter{1.5, 1, 0}, Encounter{1, nan, 0}, Encounter{1, 1, nan}}) {
    EXPECT_THROW(safe_speed_limits(path, car(), std::vector{bad}, 0, plain()), Error);
  }
  EXPECT_THROW(safe_speed_limits(path, car(), {}, nan, plain()), Error);
  SafeSpeedOptions options;
  options.risk = 2;
  EXPECT_THROW(options.validate(), Error);
}

TEST(SteerableSpeeds, AreTheRateOverTheChange) {
  VehicleLimits limits = car();
  limits.wheelbase = 2.5;
  limits.steering_rate = 0.4;
  for (const double speed : steerable_speeds(straight_path(30, 0.5), limits, 0, 0)) {
    EXPECT_GT(speed, 100);
  }
  // From straight on to a radius of 10 m at once, within 4 m as it is looked at.
  const auto turn = turn_path(10, 20, std::numbers::pi / 2, 20, 0.25);
  const auto speeds = steerable_speeds(turn, limits, 0, 0);
  EXPECT_NEAR(speeds[80], 0.8 * 0.4 * 4 / std::atan(0.25), 0.1);
  EXPECT_GT(speeds[20], 100);
  limits.wheelbase = 0;  // a robot
  EXPECT_EQ(steerable_speeds(turn, limits, 0, 0)[80], kNever);
  EXPECT_TRUE(steerable_speeds({}, car(), 0, 0).empty());
}

TEST(PathFollower, TakesSpeedLimitsFromWhereItIs) {
  const auto path = straight_path(60, 0.5);
  VehicleState state;
  PathFollowerOptions options;
  options.profile.speed = options.profile.end = 8;
  state.speed = 8;
  PathFollower follower(path, car(), state, options);
  std::vector<double> limits(path.size(), kNever);
  limits[80] = 3;
  follower.limit_speed(limits, state);
  EXPECT_EQ(follower.profile()[80], 3);
  EXPECT_EQ(follower.profile()[0], 8);
  follower.limit_speed({}, state);
  EXPECT_EQ(follower.profile()[80], 8);
  VehicleState standing;  // a vehicle that stands starts with what its engine can do
  follower.limit_speed(limits, standing);
  EXPECT_EQ(follower.profile()[0], 0);
  EXPECT_GT(follower.profile()[10], 0);
  EXPECT_THROW(follower.limit_speed({1, 2}, state), Error);
}

/// A box of 1 m somewhere in a square of 8 m beside a wall along x = 10 that ends at y = 0.
Scene yard() {
  Scene scene;
  scene.hidden.shape = BoxShape{{1, 1, 1.8}};
  scene.hidden.anchor = Anchor::base;
  Unknown x, y;
  x.component = Component::x, x.lower = 11, x.upper = 19;
  y.component = Component::y, y.lower = -4, y.upper = 4;
  scene.unknowns = {x, y};
  scene.surfaces = {testing_scenes::rectangle({10, 10, 2}, {-1, 0, 0}, 20, 4, 0.5)};
  return scene;
}

const GridGeometry kYard{120, 80, 0.25, {0, -10}};

double total(const std::vector<PoseHypothesis>& hypotheses) {
  double sum = 0;
  for (const auto& hypothesis : hypotheses) sum += hypothesis.probability;
  return sum;
}

TEST(PoseHypotheses, AgreeWithTheSpreadOverCells) {
  const Scene scene = yard();
  const PoseSpread spread(scene, kYard);
  PoseMixture mixture = spread.prior();
  mixture.presence_probability = 0.6;
  PoseMode mode;
  mode.weight = 0.7;
  mode.pose = Eigen::Vector2d(14, 1);
  mode.covariance = Eigen::Vector2d(0.3, 0.1).asDiagonal();
  mixture.modes = {mode};
  std::vector<double> not_seen(kYard.cells(), 1.0);
  for (std::size_t i = 0; i < kYard.cells(); ++i) {
    if (kYard.center(kYard.cell(i)).y() < 0) not_seen[i] = 0.1;
  }
  const auto cells = spread.occupied(mixture, not_seen);
  std::vector<double> sums(kYard.cells(), 0.0);
  const auto hypotheses = PoseHypotheses(scene, kYard).of(mixture, not_seen);
  for (const auto& hypothesis : hypotheses) {
    for (const std::size_t cell : hypothesis.touches) sums[cell] += hypothesis.probability;
  }
  EXPECT_LT(total(hypotheses), 0.6);  // part of the region was seen to be empty
  // Both state what they resolve: 0.02 of the spread, some thousandths here.
  for (std::size_t i = 0; i < cells.size(); ++i) EXPECT_NEAR(sums[i], cells[i], 0.03);
}

TEST(PoseHypotheses, OfNothingAndOfNoMixture) {
  const PoseHypotheses hypotheses(yard(), kYard);
  PoseMixture absent;
  EXPECT_TRUE(hypotheses.of(absent).empty());
  PoseMixture wrong;
  wrong.presence_probability = std::nan("");
  EXPECT_THROW(hypotheses.of(wrong), Error);
}

TEST(PathOutlook, AWallHidesWhatIsBehindItUntilTheVehicleComesToItsEnd) {
  const Scene scene = yard();
  const LineOfSight sight(scene, kYard);
  auto path = straight_path(20, 0.25);
  for (PathPoint& point : path) point.position += Eigen::Vector2d(2, 2);  // through the wall, y = 2
  PathOutlook outlook(path, {2, 1, 0}, Transform::Identity(), sight, kYard);
  // One at (15, 2), whose near edge the vehicle's front comes to at x = 14.5 - 1.
  PoseMixture there;
  there.presence_probability = 1;
  PoseMode mode;
  mode.weight = 1;
  mode.pose = Eigen::Vector2d(15, 2);
  mode.covariance = 1e-4 * Eigen::Matrix2d::Identity();
  there.modes = {mode};
  const auto encounters = outlook.encounters(PoseHypotheses(scene, kYard).of(there), 0);
  ASSERT_FALSE(encounters.empty());
  for (const Encounter& encounter : encounters) {
    EXPECT_NEAR(encounter.contact, 11.5, 0.6);  // cells, rounded to the safe side
    EXPECT_LE(encounter.contact, 11.5);
    EXPECT_NEAR(encounter.sight, 8, 1.01);  // x = 10, behind the wall
  }
  EXPECT_TRUE(outlook.encounters(PoseHypotheses(scene, kYard).of(there), 15).empty());
}

}  // namespace
}  // namespace blindcorner
