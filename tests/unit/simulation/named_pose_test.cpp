// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/named_pose.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "unit/error_message.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using namespace testing_scenes;
using testing::HasSubstr;

TEST(NamedPose, NamesLeftOutKeepTheScenesValues) {
  const Scene scene = one_narrow_zone();
  const Placement stated = stated_placements(scene).front();
  const Placement placed = placements_from(scene, "pose", {{"x_m", 7}, {"yaw_deg", 90}}).front();
  EXPECT_EQ(placed.position.x(), 7);
  EXPECT_EQ(placed.position.y(), stated.position.y());
  EXPECT_NEAR(placed.yaw, std::numbers::pi / 2, 1e-15);
  EXPECT_EQ(placed.size, stated.size);
}

TEST(NamedPose, ErrorsNameThePlaceAndWhatIsAccepted) {
  const Scene scene = one_narrow_zone();
  const auto message = [&](const NamedNumber& value) {
    return message_of([&] { placements_from(scene, "here", {value}); });
  };
  EXPECT_THAT(message({"x", 1}), HasSubstr("here: found \"x\", accepted: x_m="));
  EXPECT_THAT(message({"size", 0}), HasSubstr("here size"));
  EXPECT_THAT(message({"y_m", std::numeric_limits<double>::quiet_NaN()}),
              HasSubstr("here y_m: accepted: a finite number"));
}

TEST(NamedPose, ObjectsAreNamedWhereThereAreSeveral) {
  Scene scene = one_narrow_zone();
  scene.hidden.name = "front";
  scene.further_hidden.push_back(scene.hidden);
  scene.further_hidden.front().name = "back";
  const auto placed = placements_from(scene, "pose", {{"back.x_m", 7}});
  EXPECT_EQ(placed[1].position.x(), 7);
  EXPECT_EQ(placed[0].position.x(), scene.hidden.placement.position.x());
  EXPECT_THAT(message_of([&] {
                placements_from(scene, "pose", {{"x_m", 7}});
              }),
              HasSubstr("each after an object's name (front., back.)"));
}

TEST(NamedPose, SensorKeepsItsRotationUnlessOneIsNamed) {
  Scene scene = one_narrow_zone();
  scene.T_world_sensor.linear() = (Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()) *
                                   Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()))
                                      .toRotationMatrix();
  const Transform moved = sensor_pose_from(scene, "sensor", {{"y_m", 2}});
  EXPECT_EQ(moved.linear(), scene.T_world_sensor.linear());
  EXPECT_EQ(moved.translation().y(), 2);
  const Transform turned = sensor_pose_from(scene, "sensor", {{"yaw_rad", 0.5}});
  const Eigen::Matrix3d expected = (Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()))
                                       .toRotationMatrix();
  EXPECT_NEAR((turned.linear() - expected).norm(), 0, 1e-12);
  EXPECT_THAT(message_of([&] {
                sensor_pose_from(scene, "sensor", {{"size", 2}});
              }),
              HasSubstr("accepted: x_m, y_m, z_m, yaw_deg"));
}

}  // namespace
}  // namespace blindcorner
