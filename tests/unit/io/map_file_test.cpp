// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/map_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "blindcorner/io/ros_map.h"
#include "blindcorner/io/sensor_presets.h"
#include "unit/error_message.h"

namespace blindcorner {
namespace {

using testing::Contains;
using testing::HasSubstr;

std::string temporary(const std::string& name) {
  return (std::filesystem::path(testing::TempDir()) / name).string();
}

TEST(MapFile, MovingAiMapIsToldByItsEnding) {
  const std::string path = temporary("map_file_test.map");
  std::ofstream(path) << "type octile\nheight 2\nwidth 3\nmap\n..@\n...\n";
  const OccupancyMap map = read_map(path);
  EXPECT_EQ(map.geometry.columns, 3);
  EXPECT_EQ(map.occupancy[map.geometry.index({2, 1})], 1);
  EXPECT_EQ(map.occupancy[map.geometry.index({2, 0})], 0);
}

TEST(MapFile, UnknownCellsOfARosMapAreNaN) {
  RosMap map;
  map.geometry = {.columns = 3, .rows = 1};
  map.cells = {RosMap::kFree, RosMap::kUnknown, RosMap::kOccupied};
  const std::string path = temporary("map_file_test.yaml");
  write_ros_map(path, map);
  const OccupancyMap read = read_map(path);
  EXPECT_EQ(read.occupancy[0], 0);
  EXPECT_TRUE(std::isnan(read.occupancy[1]));
  EXPECT_EQ(read.occupancy[2], 1);
}

TEST(MapFile, OtherEndingsAreRefused) {
  EXPECT_THAT(message_of([] { read_map("map.png"); }),
              HasSubstr("accepted: .yaml (ROS map), .map"));
}

TEST(SensorPresets, EveryNameHasItsFields) {
  EXPECT_THAT(sensor_preset_names(), Contains("tmf8828_3x3_short"));
  for (const std::string& name : sensor_preset_names()) {
    EXPECT_THAT(sensor_preset_text(name), HasSubstr("\"bins\"")) << name;
  }
  EXPECT_THAT(message_of([] { sensor_preset_text("tmf"); }),
              HasSubstr("found \"tmf\", accepted: "));
}

}  // namespace
}  // namespace blindcorner
