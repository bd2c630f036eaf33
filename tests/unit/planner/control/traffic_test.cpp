// SPDX-License-Identifier: Apache-2.0
// A car that goes along x at 10 m/s, and what crosses its way.
#include "blindcorner/planner/control/traffic.h"

#include <gtest/gtest.h>

#include <cmath>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "test_paths.h"

namespace blindcorner {
namespace {

constexpr double kFriction = 8.8;  // m/s^2

class Traffic : public ::testing::Test {
 protected:
  Traffic() {
    limits_.speed = 30;
    limits_.acceleration = 5;
    limits_.friction = kFriction;
    limits_.wheelbase = 2.6;
    limits_.curvature = 0.2;
    mover_.name = "cyclist";
    mover_.body = VehicleFootprint::rectangle(1.9, 0.6);
    mover_.pose.heading = kPi / 2;
    mover_.velocity = {0, 4};
    mover_.covariance = 1e-4 * Eigen::Matrix4d::Identity();
  }
  /// The mover is on the car's way, `distance` m before its middle, after `time` s.
  TrafficDecision decide(double distance, double time, double speed = 10) {
    mover_.pose.position = Eigen::Vector2d(distance, 0) - time * mover_.velocity;
    VehicleState state;
    state.speed = speed;
    PathFollowerOptions options;
    options.profile.speed = options.profile.end = speed;
    const PathFollower follower(straight_path(100, 0.5), limits_, state, options);
    return decide_for_traffic(follower, state, body_, kFriction, {&mover_, 1}, options_);
  }

  VehicleLimits limits_;
  VehicleFootprint body_ = VehicleFootprint::rectangle(4.5, 1.8);
  Mover mover_;
  TrafficOptions options_;
};

TEST_F(Traffic, WhoWillHavePassedIsNotBrakedFor) {
  EXPECT_EQ(decide(30, 1.5).braking, 0);  // 6 m farther when the car is there
  EXPECT_EQ(decide(30, 1.5).probability, 0);
  EXPECT_EQ(decide(30, 4.5).braking, 0);  // comes when the car has passed
}

// 30 m before the place are 26.6 m to stop: 1.9 m/s^2. That may wait, and 4.4 m/s^2 may not.
TEST_F(Traffic, BrakesWhenItHasToAndAsHardAsItHasTo) {
  const TrafficDecision early = decide(30, 3);
  EXPECT_EQ(early.braking, 0);
  EXPECT_NEAR(early.probability, 1, 1e-9);
  EXPECT_NEAR(early.time, 2.7, 0.2);  // their ends meet before their middles
  EXPECT_EQ(early.mover, "cyclist");
  const TrafficDecision now = decide(15, 1.5);
  EXPECT_GE(now.braking, 0.45);
  EXPECT_LE(now.braking, 0.7);
  options_.comfortable = 0.05;  // who brakes already goes on doing so
  EXPECT_GT(decide(30, 3).braking, 0);
  EXPECT_LE(decide(30, 3).braking, 0.35);
}

TEST_F(Traffic, BrakesUpToTheFrictionLimitWhereItIsTooLate) {
  EXPECT_EQ(decide(7, 0.7).braking, 1);
}

// Inside the margin all courses begin with a breach of it: what counts is that nobody is touched.
TEST_F(Traffic, StopsWithinTheMarginToo) {
  mover_.pose.heading = 0;  // 1.9 m along the car's way, and he crosses it slowly
  mover_.velocity = {0, 0.6};
  const TrafficDecision decision = decide(2.25 + 0.95 + 0.25, 0.2, 1);
  EXPECT_GT(decision.braking, 0.2);
}

// Bodies are discs that bulge beyond corners: one that seems touched already is no reason to go on.
TEST_F(Traffic, BrakesWhereDiscsTouchAlready) {
  EXPECT_EQ(decide(2.25 + 0.3 + 0.1, 0.2, 1).braking, 1);
}

// From standstill it drives off as hard as its follower does, and would reach who is still there.
TEST_F(Traffic, DrivesOffWhenTheWayIsClear) {
  mover_.velocity = {0, 2};
  EXPECT_GT(decide(3.5, 0, 14).probability, 0.9);
  PathFollowerOptions options;
  options.profile.speed = options.profile.end = 6;
  VehicleState moving, standing;
  moving.speed = 6;
  const PathFollower follower(straight_path(100, 0.5), limits_, moving, options);
  mover_.pose.position = {3.4, 0.2};
  options_.comfortable = 0.05;
  EXPECT_GT(
      decide_for_traffic(follower, standing, body_, kFriction, {&mover_, 1}, options_).probability,
      0.9)
      << "0.9 m before him, at 5 m/s^2 that is 0.6 s; he is in the way for 0.5 s and the margin";
  mover_.pose.position = {3.4, 1.6};
  EXPECT_EQ(
      decide_for_traffic(follower, standing, body_, kFriction, {&mover_, 1}, options_).braking, 0);
}

TEST_F(Traffic, WhatIsUnlikelyIsTaken) {
  mover_.probability = 0.01;
  EXPECT_EQ(decide(15, 1.5).braking, 0);
  EXPECT_NEAR(decide(15, 1.5).probability, 0.01, 1e-9);
  options_.risk = 0.005;
  EXPECT_GT(decide(15, 1.5).braking, 0);
}

// Where he will be is known the less the farther ahead.
TEST_F(Traffic, AnUncertainVelocityIsAnUncertainMeeting) {
  mover_.covariance(2, 2) = mover_.covariance(3, 3) = 4;
  const double near = decide(10, 1).probability, far = decide(40, 4).probability;
  EXPECT_GT(near, far + 0.1);
  EXPECT_GT(far, 0.02);
  mover_.covariance(2, 2) = mover_.covariance(3, 3) = 1e-4;
  mover_.acceleration_density = 1;
  EXPECT_LT(decide(40, 4).probability, decide(10, 1).probability);
}

TEST_F(Traffic, RefusesNonsense) {
  options_.risk = 2;
  EXPECT_THROW(decide(15, 1.5), Error);
}

TEST(Mover, IsKnownTheLessTheLaterItIs) {
  Mover mover;
  mover.pose.position = {1, 2};
  mover.velocity = {0, 3};
  mover.covariance.diagonal() << 0.04, 0.04, 0.25, 0.25;
  mover.acceleration_density = 0.3;
  EXPECT_NEAR((mover.at(2).position - Eigen::Vector2d(1, 8)).norm(), 0, 1e-12);
  EXPECT_NEAR(mover.sigma_at(0), 0.2, 1e-12);
  EXPECT_NEAR(mover.sigma_at(2), std::sqrt(0.04 + 4 * 0.25 + 0.3 * 8 / 3), 1e-12);
}

TEST(MoverAvoidance, IsOfPlaceAndTime) {
  Mover mover;
  mover.body = VehicleFootprint::rectangle(1.9, 0.6);
  mover.pose = {{20, -8}, kPi / 2};
  mover.velocity = {0, 4};
  const VehicleFootprint car = VehicleFootprint::rectangle(4.5, 1.8);
  const MoverAvoidance avoidance{{&mover, 1}, 10};
  EXPECT_TRUE(avoidance.meets(car, {{20, 0}, 0}, 20, {{0, 0}, 0}));   // both after 2 s
  EXPECT_FALSE(avoidance.meets(car, {{20, 0}, 0}, 35, {{0, 0}, 0}));  // he has gone by then
  EXPECT_FALSE(avoidance.meets(car, {{12, 0}, 0}, 12, {{0, 0}, 0}));
  EXPECT_FALSE(avoidance.meets(car, {{20, -8}, 0}, 0, {{20, -8}, 0}));  // in him already
  mover.probability = 0.1;
  EXPECT_FALSE(avoidance.meets(car, {{20, 0}, 0}, 20, {{0, 0}, 0}));
}

}  // namespace
}  // namespace blindcorner
