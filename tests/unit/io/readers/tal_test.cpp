// SPDX-License-Identifier: Apache-2.0
/// tal's HDF5, written and read back; tests/peers/tal.sh has tal itself read it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "blindcorner/forward/constants.h"
#include "blindcorner/io/export_file.h"
#include "blindcorner/io/import_file.h"
#include "io/hdf5_file.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using test::error_of;
using test::read_text;
using test::TemporaryFolder;
using test::write_text;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Captures of 2 x 3 zones that look at points of the wall y = 0, the sensor two metres before it.
CaptureFile before_a_wall(int captures = 1) {
  CaptureFile file = test::make_captures(captures, 2, 3, 5);
  for (Capture& capture : file.captures) {
    capture.relay_points.emplace();
    for (int zone = 0; zone < 6; ++zone) {
      capture.relay_points->emplace_back(0.5 * (zone % 3), 0, 1 + 0.25 * (zone / 3));
    }
    capture.T_world_sensor = Transform::Identity();
    capture.T_world_sensor->translation() = Eigen::Vector3d(0.5, -2, 1.125);
  }
  return file;
}

class Tal : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!has_hdf5()) GTEST_SKIP() << "built without libhdf5";
  }
  TemporaryFolder folder_;
  std::string path_ = folder_.file("a.hdf5");
};

TEST_F(Tal, WhatIsWrittenComesBack) {
  const CaptureFile file = before_a_wall();
  ExportOptions options;
  options.confocal = true;
  options.time_zero = 1e-9;
  export_captures(path_, file, options);
  std::vector<std::string> notes;
  const CaptureFile back = import_captures({path_}, {}, &notes);
  ASSERT_EQ(back.captures.size(), 1u);
  const Capture& capture = back.captures[0];
  EXPECT_EQ(capture.counts.rows, 2);
  EXPECT_EQ(capture.counts.values, file.captures[0].counts.values);  // exact in single precision
  EXPECT_NEAR(back.bin_width, file.bin_width, 1e-6 * file.bin_width);
  for (std::size_t zone = 0; zone < 6; ++zone) {
    EXPECT_TRUE(
        (*capture.relay_points)[zone].isApprox((*file.captures[0].relay_points)[zone], 1e-6));
  }
  EXPECT_TRUE(capture.T_world_sensor->translation().isApprox(Eigen::Vector3d(0.5, -2, 1.125)));
  EXPECT_TRUE((capture.T_world_sensor->linear() * Eigen::Vector3d::UnitX())
                  .isApprox(Eigen::Vector3d::UnitY(), 1e-6));  // at the middle of the wall's points
  EXPECT_THAT(back.description, HasSubstr("confocal"));
  EXPECT_THAT(notes, Contains(AllOf(HasSubstr("-0.299792 m"), HasSubstr("time_zero_ps is 1000"))));
}

TEST_F(Tal, TheWallIsTurnedIntoItsFrame) {
  export_captures(path_, before_a_wall());
  const Hdf5Reader raw(path_);
  const NpyArray grid = raw.numbers("sensor_grid_xyz");
  EXPECT_EQ(grid.shape, (std::vector<std::size_t>{2, 3, 3}));
  EXPECT_EQ(grid.values[15 + 0], 1.0);   // x
  EXPECT_EQ(grid.values[15 + 1], 1.25);  // height
  EXPECT_EQ(grid.values[15 + 2], 0.0);   // the wall
  EXPECT_EQ(raw.numbers("sensor_xyz").values[2], 2.0);
  EXPECT_EQ(raw.number("H_format"), 1);
  EXPECT_FALSE(raw.has("laser_grid_xyz"));  // not known, so that it is empty
}

TEST_F(Tal, OneSpotOfTheLaserAndListsOfSensors) {
  Hdf5Writer writer;
  writer.floats("H", {3, 1, 4}, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});
  writer.enumerator("H_format", {{"T_Li_Si", 4}}, 4);
  writer.floats("delta_t", {}, {0.03});
  writer.floats("laser_grid_xyz", {1, 3}, {0.1, 0.2, 0});
  write_text(path_, writer.bytes());
  std::vector<std::string> notes;
  const CaptureFile file = import_captures({path_}, {}, &notes);
  EXPECT_EQ(file.captures[0].counts.zones(), 4);
  EXPECT_EQ(file.captures[0].counts.zone(1)[2], 9);
  EXPECT_NEAR(file.bin_width, 0.03 / kSpeedOfLight, 1e-15);
  EXPECT_THAT(file.description, HasSubstr("laser spot at 0.1, 0, 0.2"));
  EXPECT_THAT(notes, Contains(HasSubstr("begin and end at the relay wall")));
}

TEST_F(Tal, WhatCannotBeACaptureIsRefused) {
  Hdf5Writer two;
  two.floats("H", {1, 2, 2}, {1, 2, 3, 4});
  two.enumerator("H_format", {{"T_Li_Si", 4}}, 4);
  two.floats("delta_t", {}, {0.03});
  write_text(path_, two.bytes());
  EXPECT_THAT(error_of([&] { import_captures({path_}); }),
              AllOf(HasSubstr("dataset H"), HasSubstr("one spot of the laser")));
  Hdf5Writer vast;  // its numbers are never written, and are zero to who reads them
  vast.floats("H", {1000, 1000, 100}, {});
  vast.enumerator("H_format", {{"T_Sx_Sy", 1}}, 1);
  vast.floats("delta_t", {}, {0.03});
  write_text(path_, vast.bytes());
  EXPECT_THAT(error_of([&] { import_captures({path_}); }),
              AllOf(HasSubstr("dataset H"), HasSubstr("the file holds 0 bytes only")));
  export_captures(path_, before_a_wall());
  const std::string bytes = read_text(path_);
  for (std::size_t length = 8; length < bytes.size(); length += 997) {
    write_text(path_, bytes.substr(0, length));
    EXPECT_THAT(error_of([&] { import_captures({path_}); }), HasSubstr(path_)) << length;
  }
}

TEST_F(Tal, ExportSaysWhatItNeeds) {
  EXPECT_THAT(error_of([&] { export_captures(path_, before_a_wall(2)); }),
              HasSubstr("--capture chooses"));
  ExportOptions options;
  options.capture = 1;
  export_captures(path_, before_a_wall(2), options);
  EXPECT_EQ(import_captures({path_}).captures[0].counts.values[0], 1000);
  options.capture = 2;
  EXPECT_THAT(error_of([&] { export_captures(path_, before_a_wall(2), options); }),
              HasSubstr("accepted 0 to 1"));
  EXPECT_THAT(error_of([&] { export_captures(folder_.file("a.npz"), before_a_wall(), options); }),
              HasSubstr("for .hdf5 (tal) only"));
  CaptureFile bare = test::make_captures(1, 2, 3, 5);
  options = {};
  options.confocal = true;
  EXPECT_THAT(error_of([&] { export_captures(path_, bare, options); }), HasSubstr("confocal: "));
  bare.bin_width = 0;
  EXPECT_THAT(error_of([&] { export_captures(path_, bare); }), HasSubstr("how wide a bin is"));
}

}  // namespace
}  // namespace blindcorner
