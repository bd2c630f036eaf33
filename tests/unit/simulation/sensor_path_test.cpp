// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/sensor_path.h"

#include <gtest/gtest.h>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/scene/orientation.h"
#include "bundled.h"

namespace blindcorner {
namespace {

using Eigen::Vector3d;

Transform pose(const Vector3d& position, const Vector3d& yaw_pitch_roll_deg) {
  Transform T = Transform::Identity();
  T.translation() = position;
  T.linear() = rotation_of(yaw_pitch_roll_deg * kDegree);
  return T;
}

TEST(Orientation, AnglesComeBack) {
  for (const Vector3d& angles : {Vector3d(10, -20, 30), Vector3d(-170, 85, -100), Vector3d(0, 0, 0),
                                 Vector3d(40, 90, 0), Vector3d(-130, -90, 0)}) {
    EXPECT_TRUE(yaw_pitch_roll_of(rotation_of(angles * kDegree)).isApprox(angles * kDegree, 1e-9))
        << angles.transpose();
  }
}

TEST(SensorPath, IsEvenlySpacedAndKeepsItsEnds) {
  const Transform from = pose({0, 0, 1}, {0, 0, 0});
  const Transform to = pose({3, 1.5, 1}, {30, 0, 0});
  const auto path = sensor_path({from, to}, 4);
  ASSERT_EQ(path.size(), 4U);
  EXPECT_TRUE(path.front().isApprox(from, 0));
  EXPECT_TRUE(path.back().isApprox(to, 0));
  EXPECT_TRUE(path[1].isApprox(pose({1, 0.5, 1}, {10, 0, 0}), 1e-12));
  EXPECT_TRUE(path[2].isApprox(pose({2, 1, 1}, {20, 0, 0}), 1e-12));
}

TEST(SensorPath, GoesThroughAllPosesAndTurnsTheShortWay) {
  const Transform a = pose({0, 0, 0}, {170, 0, 0});
  const Transform b = pose({1, 0, 0}, {-170, 0, 0});
  const Transform c = pose({1, 5, 0}, {-170, 0, 0});
  const auto path = sensor_path({a, b, c}, 5);
  EXPECT_TRUE(path[1].isApprox(pose({0.5, 0, 0}, {180, 0, 0}), 1e-12));
  EXPECT_TRUE(path[2].isApprox(b, 0));
  EXPECT_TRUE(path[3].isApprox(pose({1, 2.5, 0}, {-170, 0, 0}), 1e-12));
}

TEST(SensorPath, OnePoseStands) {
  const Transform a = pose({1, 2, 3}, {4, 5, 6});
  for (const Transform& T : sensor_path({a}, 3)) EXPECT_TRUE(T.isApprox(a, 0));
  EXPECT_THROW(sensor_path({}, 3), Error);
  EXPECT_THROW(sensor_path({a}, 0), Error);
}

// The car drives 6 m along the street and turns left, towards the corner; the relay stays in view.
TEST(SensorPath, ForwardEndOfTheStreet) {
  const Scene scene = bundled_scene("street_corner");
  const Transform end = forward_end(scene);
  const Vector3d moved = end.translation() - scene.T_world_sensor.translation();
  // The facade is at x = 26 m: 0.3 * 19 m / cos(15 deg).
  EXPECT_NEAR(moved.norm(), 0.3 * 19 / std::cos(15 * kDegree), 1e-4);
  EXPECT_NEAR(moved.z(), 0, 1e-12);
  EXPECT_NEAR(std::atan2(moved.y(), moved.x()), 15 * kDegree, 1e-9);
  EXPECT_NEAR(yaw_pitch_roll_of(end.linear())[0], 15 * kDegree + 0.1, 1e-9);
  for (const Transform& T : sensor_path({scene.T_world_sensor, end}, 5)) {
    EXPECT_NO_THROW(seen_from(scene, T));
  }
}

TEST(SensorPath, WithoutARelayInViewIsRefused) {
  const Scene scene = bundled_scene("tmf8828_wall");
  EXPECT_THROW(seen_from(scene, pose({0, 0, 1}, {180, 0, 0})), Error);
}

}  // namespace
}  // namespace blindcorner
