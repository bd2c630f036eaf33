// SPDX-License-Identifier: Apache-2.0
// Two hidden objects of which one comes in direct sight.
#include "simulation/sightings.h"

#include <gtest/gtest.h>

#include <cmath>

#include "blindcorner/simulation/drive_claims.h"
#include "bundled.h"
#include "simulation/movers.h"

namespace blindcorner {
namespace {

const Drive& street() { return bundled_drive("street_two"); }

PoseVector truth() { return Eigen::Vector4d(22, 23, 18, 20); }

TEST(Sightings, OneInSightDoesNotGiveAwayTheOther) {
  Sightings sightings(street().scene, street().motion);
  EXPECT_FALSE(sightings.any());
  sightings.see({false, true}, truth(), 1);
  const PerceptionAnswer answer = sightings.answer({}, 0, 1);
  const PoseMode& mode = answer.mixture->modes.front();
  EXPECT_EQ(answer.flags, std::vector<std::string>{"partly_in_sight"});
  EXPECT_NEAR(mode.pose[2], 18, 1e-12);
  EXPECT_NEAR(std::sqrt(mode.covariance(2, 2)), kKnownPosition, 1e-12);
  // Nothing was perceived, so the other one is anywhere: its prior, and no trace of the truth.
  EXPECT_NEAR(mode.pose[0], 22.25, 1e-12);
  EXPECT_NEAR(mode.covariance(1, 1), 100 / 12.0, 1e-9);
  EXPECT_EQ(mode.undetermined, (std::vector<int>{0, 1}));
}

TEST(Sightings, TheOtherOneStaysAsPerceivedAndAges) {
  Sightings sightings(street().scene, street().motion);
  PerceptionAnswer perceived;
  perceived.mixture = known_pose(street().scene, truth() + PoseVector::Constant(4, 0.5));
  PoseVelocity velocity = HiddenMotion(street().scene, street().motion, 60).any_velocity();
  velocity.mean = Eigen::Vector4d(0, -2, 0, 0);
  velocity.covariance(1, 1) = 0.09;
  perceived.velocities = {velocity};
  sightings.see({false, true}, truth(), 1);
  const PerceptionAnswer answer = sightings.answer(perceived, 0.5, 1);
  const PoseMode& mode = answer.mixture->modes.front();
  EXPECT_NEAR(mode.pose[1], 23.5 - 1, 1e-12);
  const double q = street().motion.acceleration_density;
  EXPECT_NEAR(mode.covariance(1, 1), 0.02 * 0.02 + 0.25 * 0.09 + q * 0.125 / 3, 1e-12);
  EXPECT_NEAR(answer.velocities.front().with_pose(1, 1), 0.5 * 0.09, 1e-12);
  EXPECT_NEAR(mode.pose[3], 20, 1e-12);  // seen, whatever was perceived
  EXPECT_EQ(answer.mixture->presence_probability, 1);
  sightings.see({true, false}, truth(), 2);
  const PerceptionAnswer both = sightings.answer(perceived, 1.5, 2);
  EXPECT_EQ(both.flags, std::vector<std::string>{"in_sight"});
  EXPECT_NEAR((both.mixture->mean - truth()).norm(), 0, 1e-12);
}

TEST(Sightings, WhatIsSeenIsTracked) {
  Motion motion;
  motion.initial_speed = 3;
  motion.acceleration_density = 0.5;
  Sightings sightings(street().scene, motion);
  const Eigen::Vector4d velocity(0, 0, 0, -4);
  for (int i = 0; i < 6; ++i) sightings.see({false, true}, truth() + 0.1 * i * velocity, 0.1 * i);
  const PerceptionAnswer answer = sightings.answer({}, 0, 0.5);
  EXPECT_NEAR(answer.velocities.front().mean[3], -4, 0.2);
  EXPECT_LT(answer.velocities.front().covariance(3, 3), 0.3 * 0.3);
  EXPECT_NEAR(answer.mixture->modes.front().pose[3], truth()[3] - 2, 0.05);
  // Out of sight it goes on.
  const PerceptionAnswer later = sightings.answer({}, 0, 1.5);
  EXPECT_NEAR(later.mixture->modes.front().pose[3], truth()[3] - 6, 0.3);
  EXPECT_GT(later.mixture->modes.front().covariance(3, 3), 0.1 * 0.1);
}

TEST(Sightings, AVelocityThatWasPerceivedIsNotForgottenAtFirstSight) {
  Motion motion;
  motion.initial_speed = 3;
  Sightings sightings(street().scene, motion);
  PerceptionAnswer perceived;
  perceived.mixture = known_pose(street().scene, truth());
  PoseVelocity velocity = HiddenMotion(street().scene, motion, 60).any_velocity();
  velocity.mean = Eigen::Vector4d(0, 0, 0, -4);
  velocity.covariance *= 0.01;
  perceived.velocities = {velocity};
  sightings.see({false, true}, truth(), 1, perceived);
  EXPECT_NEAR(sightings.answer(perceived, 0, 1).velocities.front().mean[3], -4, 1e-6);
}

TEST(Movers, WhatMovesIsTakenOutOfTheMap) {
  HiddenAnswer answer;
  answer.mixture = known_pose(street().scene, truth());
  PoseVelocity velocity = HiddenMotion(street().scene, street().motion, 60).any_velocity();
  velocity.covariance = 0.01 * Eigen::Matrix4d::Identity();
  velocity.mean = Eigen::Vector4d(0, 0, 0, -4);
  answer.velocities = {velocity};
  answer.age = 0.5;
  const StandingAndMoving split = split_by_motion(street().scene, street().motion, answer);
  ASSERT_EQ(split.moving.size(), 1U);
  const Mover& mover = split.moving.front();
  EXPECT_EQ(mover.name, hidden_object(street().scene, 1).name);
  EXPECT_NEAR(mover.pose.position.y(), truth()[3] - 2, 1e-9);
  EXPECT_NEAR(mover.covariance(1, 3), 0.5 * 0.01, 1e-9);
  EXPECT_GT(mover.probability, 0.99 * std::exp(-0.5 / 60));
  const PoseVector& left = split.standing.mixture.modes.front().pose;
  EXPECT_EQ(left.head<2>(), truth().head<2>());
  EXPECT_TRUE(left.tail<2>().array().isNaN().all());
  // Who may have any velocity may move at once; who is known to sway by little stands.
  answer.velocities.front().mean.setZero();
  answer.velocities.front().covariance = 9 * Eigen::Matrix4d::Identity();
  EXPECT_EQ(split_by_motion(street().scene, street().motion, answer).moving.size(), 2U);
  // Of an object of which only the prior is known nobody brakes.
  answer.velocities.front().covariance = 9 * Eigen::Matrix4d::Identity();
  answer.mixture.modes.front().undetermined = {0, 1};
  const StandingAndMoving one = split_by_motion(street().scene, street().motion, answer);
  ASSERT_EQ(one.moving.size(), 1U);
  EXPECT_EQ(one.moving.front().name, hidden_object(street().scene, 1).name);
  answer.mixture.modes.front().undetermined.clear();
  // Who is no likelier than before anything was perceived is not braked for, nor lost.
  answer.mixture.presence_probability = street().scene.presence_prior;
  const StandingAndMoving doubtful = split_by_motion(street().scene, street().motion, answer);
  EXPECT_TRUE(doubtful.moving.empty());
  EXPECT_FALSE(doubtful.standing.mixture.modes.front().pose.array().isNaN().any());
  answer.mixture.presence_probability = 1;
  answer.velocities.front().covariance = 0.01 * Eigen::Matrix4d::Identity();
  EXPECT_TRUE(split_by_motion(street().scene, street().motion, answer).moving.empty());
}

/// A frame of a car that drives along x, 0.1 s after the one before.
DriveFrame frame_at(int i) {
  DriveFrame frame;
  frame.time = 0.1 * i;
  frame.vehicle.position = {i, 0};
  frame.truth = truth();
  return frame;
}

/// A drive of two frames with an answer that is off by one standard deviation along x and y of both
/// objects, then by ten.
TEST(DriveClaims, CountsWhatIsHonestAndWhatIsWrong) {
  DriveResult result;
  for (int i = 0; i < 3; ++i) {
    DriveFrame frame = frame_at(i);
    const double sigmas = i == 1 ? 1 : 10;
    if (i > 0) {
      frame.mixture =
          known_pose(street().scene, truth() + PoseVector::Constant(4, sigmas * kKnownPosition));
      frame.mixture_age = 0.1;
    }
    result.frames.push_back(frame);
  }
  const DriveClaims claims = drive_claims(street(), result);
  EXPECT_EQ(claims.answers, 2);
  EXPECT_EQ(claims.sure, 2);
  EXPECT_EQ(claims.covered, 1);
  EXPECT_EQ(claims.wrong, 1);
  EXPECT_EQ(claims.wrong_flagged, 0);
  EXPECT_NEAR(*claims.at_capture.ratio(), (1 + 100) / 2.0, 1e-9);
  EXPECT_LT(*claims.in_map.ratio(), *claims.at_capture.ratio());  // it may have moved since
  ASSERT_TRUE(claims.first);
  EXPECT_NEAR(claims.first->lead, 1, 1e-12);
  EXPECT_NEAR(claims.first->distance, std::hypot(17.0, 20.0), 1e-12);
}

TEST(DriveClaims, CountsAnswersAboutWhoLeftTheSearchRegionApart) {
  DriveResult result;
  PoseVector away = truth();
  away[0] = street().scene.unknowns[0].upper + 0.1;
  for (int i = 0; i < 3; ++i) {
    DriveFrame frame = frame_at(i);
    if (i == 2) frame.truth = away;
    if (i > 0) frame.mixture = known_pose(street().scene, truth());
    result.frames.push_back(frame);
  }
  const DriveClaims claims = drive_claims(street(), result);
  EXPECT_EQ(claims.outside, 1);
  EXPECT_EQ(claims.answers, 1);
  EXPECT_EQ(claims.covered, 1);
  EXPECT_EQ(claims.wrong, 0);
}

}  // namespace
}  // namespace blindcorner
