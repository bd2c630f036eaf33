// SPDX-License-Identifier: Apache-2.0
// Drive files: the shipped ones are accepted, every wrong one is refused with one line that names
// the file, the field, what was found and what is accepted.
#include "blindcorner/io/drive_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

const std::string kScenes = std::string(SOURCE_DIR) + "/scenes/";

json shipped() {
  std::ifstream file(kScenes + "robot_drive.json");
  json drive = json::parse(file);
  drive["scene"] = kScenes + "robot_corridor.json";
  return drive;
}

Drive read_changed(const std::function<void(json&)>& change) {
  const test::TemporaryFolder folder;
  json drive = shipped();
  change(drive);
  std::ofstream(folder.file("test.json")) << drive.dump();
  return read_drive(folder.file("test.json"));
}

std::string refusal_of(const std::function<void(json&)>& change) {
  try {
    read_changed(change);
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(DriveFile, ShippedOnesAreAccepted) {
  const Drive robot = read_drive(kScenes + "robot_drive.json");
  EXPECT_EQ(robot.vehicle.kind, VehicleKind::robot);
  EXPECT_EQ(robot.scene.name, "robot_corridor");
  EXPECT_DOUBLE_EQ(robot.sensor.rate, 5);
  EXPECT_DOUBLE_EQ(robot.motion.frame_interval, 0.2);
  // 4.2 m x 5.4 m of 5 cm: whole numbers of cells in spite of rounding.
  EXPECT_EQ(robot.map.columns, 84);
  EXPECT_EQ(robot.map.rows, 108);
  const Drive street = read_drive(kScenes + "street_drive.json");
  EXPECT_EQ(street.vehicle.kind, VehicleKind::car);
  EXPECT_TRUE(street.scene.sensor.link);
}

TEST(DriveFile, TruthIsStatedOrDrawn) {
  const Drive drive = read_changed([](json& d) { d["hidden"] = {{"x_m", 0.5}}; });
  ASSERT_EQ(drive.truth.components.size(), 2U);
  EXPECT_DOUBLE_EQ(drive.truth.components[0]->lower, 0.5);
  EXPECT_DOUBLE_EQ(drive.truth.components[0]->upper, 0.5);
  EXPECT_FALSE(drive.truth.components[1]);
}

TEST(DriveFile, SpeedModeRiskAndCornerAreRead) {
  EXPECT_EQ(read_changed([](json&) {}).speed_mode, SpeedMode::wanted);
  const Drive drive = read_changed([](json& d) {
    d["speed_mode"] = "safe";
    d["risk"] = 0.01;
    d["closing_speed_m_per_s"] = 2;
    d["hidden"] = {{"present", 0.25}};
    d["trials"] = {
        {"speed_m_per_s", {1, 2}}, {"zones", 2}, {"corner_m", {0.5, 1}}, {"corner_radius_m", 3}};
  });
  EXPECT_EQ(drive.speed_mode, SpeedMode::safe);
  EXPECT_EQ(drive.risk, 0.01);
  EXPECT_EQ(drive.closing_speed, 2);
  EXPECT_EQ(drive.truth.present, 0.25);
  EXPECT_EQ(drive.trials.corner_radius, 3);
  EXPECT_EQ(drive.trials.corner, Eigen::Vector2d(0.5, 1));
  EXPECT_EQ(read_drive(kScenes + "street_safe_drive.json").speed_mode, SpeedMode::safe);
}

TEST(DriveFile, ThePublishedControllerChoosesNoSpeed) {
  EXPECT_EQ(read_changed([](json&) {}).controller, DriveController::own);
  EXPECT_EQ(read_changed([](json& d) { d["controller"] = "published"; }).controller,
            DriveController::published);
  EXPECT_EQ(read_drive(kScenes + "published_turn_drive.json").controller,
            DriveController::published);
  EXPECT_THROW(read_changed([](json& d) {
                 d["controller"] = "published";
                 d["speed_mode"] = "safe";
               }),
               Error);
}

TEST(DriveFile, ARouteEndsAtAPointOrALine) {
  const Drive point = read_changed([](json&) {});
  EXPECT_FALSE(point.finish_line);
  const Drive line = read_changed([](json& d) {
    d.erase("route_m");
    d["finish_line_m"] = {{0, 2.9}, {2, 2.9}};
  });
  EXPECT_TRUE(line.route.empty());
  ASSERT_TRUE(line.finish_line);
  EXPECT_EQ(line.finish_line->back(), Eigen::Vector2d(2, 2.9));
  const Drive both = read_changed([](json& d) { d["finish_line_m"] = {{0, 2.9}, {2, 2.9}}; });
  EXPECT_EQ(both.route.size(), 1U);
  EXPECT_TRUE(both.finish_line);
}

TEST(DriveFile, FrictionLaneAndMeetingAreRead) {
  EXPECT_DOUBLE_EQ(read_changed([](json&) {}).vehicle.friction, 0.9);
  const Drive drive = read_changed([](json& d) {
    d["vehicle"]["mu"] = 0.3;
    d["traffic_risk"] = 0.1;
    d["lane"] = {{"lower_m", {-2, 0}}, {"upper_m", {2, 1}}};
    d["hidden"]["meeting"] = {{"at_m", {0.5, 1}}, {"after_s", 3}, {"spread_m", 0.2}};
    d["hidden"]["turn"] = {{"after_s", 2}, {"velocity_m_per_s", {0, -1}}};
    d["sensor"]["ambient"] = 10;
  });
  EXPECT_DOUBLE_EQ(drive.vehicle.friction, 0.3);
  EXPECT_DOUBLE_EQ(drive.traffic_risk, 0.1);
  ASSERT_TRUE(drive.lane);
  EXPECT_TRUE(drive.lane->contains(Eigen::Vector2d(1, 0.5)));
  ASSERT_TRUE(drive.truth.meeting);
  EXPECT_DOUBLE_EQ(drive.truth.meeting->time, 3);
  ASSERT_TRUE(drive.truth.turn);
  EXPECT_DOUBLE_EQ(drive.truth.turn->time, 2);
  EXPECT_EQ(drive.truth.turn->velocity.at(0), Eigen::Vector2d(0, -1));
  EXPECT_DOUBLE_EQ(drive.sensor.ambient, 10);
}

TEST(DriveFile, WrongOnesGetOneLine) {
  const auto expect = [](const std::function<void(json&)>& change, const std::string& field,
                         const std::string& found) {
    const std::string message = refusal_of(change);
    json drive = shipped();
    change(drive);
    test::keep_refused("drive", drive.dump(), message);
    EXPECT_THAT(message, HasSubstr("test.json: " + field));
    EXPECT_THAT(message, HasSubstr(found));
    EXPECT_THAT(message, HasSubstr("accepted"));
    EXPECT_EQ(message.find('\n'), std::string::npos);
  };
  expect([](json& d) { d["sensors"] = 3; }, "sensors", "did you mean \"sensor\"");
  expect([](json& d) { d.erase("scene"); }, "scene", "nothing");
  expect([](json& d) { d["scene"] = "none.json"; }, "scene", "none.json");
  expect([](json& d) { d["vehicle"]["kind"] = "boat"; }, "vehicle.kind", "boat");
  expect([](json& d) { d["vehicle"]["turning_radius_m"] = -1; }, "vehicle.turning_radius_m", "-1");
  expect([](json& d) { d["vehicle"]["cornering_share"] = 0; }, "vehicle.cornering_share", "0");
  expect([](json& d) { d["vehicle"]["localization"]["sigma_m"] = -1; },
         "vehicle.localization.sigma_m", "-1");
  expect([](json& d) { d["vehicle"].erase("start"); }, "vehicle.start", "nothing");
  expect(
      [](json& d) {
        d["vehicle"]["start"]["position_m"] = {9, 9};
      },
      "vehicle.start.position_m", "on the map");
  expect([](json& d) { d["route_m"] = json::array(); }, "route_m", "found");
  expect([](json& d) { d["route_m"][0] = {0.5, 40}; }, "route_m[0]", "on the map");
  expect([](json& d) { d.erase("route_m"); }, "route_m", "nothing");
  expect([](json& d) { d["finish_line_m"] = {{0, 2}}; }, "finish_line_m", "ends of a line");
  expect([](json& d) { d["finish_line_m"] = {{0, 2}, {0, 2}}; }, "finish_line_m[1]", "another");
  expect([](json& d) { d["finish_line_m"] = {{0, 2}, {0, 90}}; }, "finish_line_m[1]", "on the map");
  expect([](json& d) { d["speed_m_per_s"] = -1; }, "speed_m_per_s", "-1");
  expect([](json& d) { d["speed_m_per_s"] = {3, 2}; }, "speed_m_per_s", "3");
  expect([](json& d) { d["sensor"]["rate_hz"] = 0; }, "sensor.rate_hz", "0");
  expect([](json& d) { d["sensor"]["faults"]["late_share"] = 0.5; }, "sensor.faults.late_by_s",
         "nothing");
  expect([](json& d) { d["map"]["upper_m"] = {-3, 4}; }, "map.upper_m", "above");
  expect([](json& d) { d["map"]["cell_m"] = 0.001; }, "map.cell_m", "4 million");
  expect([](json& d) { d["hidden"]["x_m"] = 7; }, "hidden.x_m", "7");
  expect([](json& d) { d["hidden"]["z_m"] = 0; }, "hidden.z_m", "unknown field");
  expect([](json& d) { d["perception"]["delay_s"]["los"] = -1; }, "perception.delay_s.los", "-1");
  expect([](json& d) { d["vehicle"]["mu"] = 0; }, "vehicle.mu", "0");
  expect([](json& d) { d["traffic_risk"] = 2; }, "traffic_risk", "2");
  expect(
      [](json& d) {
        d["lane"] = {{"lower_m", {0, 0}}, {"upper_m", {-1, 1}}};
      },
      "lane.upper_m", "above");
  expect(
      [](json& d) {
        d["hidden"]["meeting"] = {{"at_m", {0, 1}}};
      },
      "hidden.meeting.after_s", "nothing");
  expect([](json& d) { d["speed_mode"] = "fast"; }, "speed_mode", "fast");
  expect([](json& d) { d["risk"] = 0.01; }, "risk", "speed_mode is \"safe\"");
  expect(
      [](json& d) {
        d["speed_mode"] = "safe";
        d["risk"] = 1.5;
      },
      "risk", "1.5");
  expect([](json& d) { d["hidden"]["present"] = "maybe"; }, "hidden.present", "maybe");
  expect([](json& d) { d["hidden"]["present"] = 2; }, "hidden.present", "2");
}

}  // namespace
}  // namespace blindcorner
