// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/export_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "blindcorner/io/import_file.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using test::error_of;
using test::make_captures;
using test::read_text;
using test::TemporaryFolder;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(ExportTest, NpzComesBackWhole) {
  TemporaryFolder folder;
  CaptureFile written = make_captures(3, 2, 3, 5);
  written.description = "Umlaut ü, sign €, emoji 🙂";  // code points of 2, 3 and 4 bytes
  Capture& capture = written.captures[1];
  capture.counts.values[0] = -0.1;  // double precision is kept
  capture.counts.values[1] = std::nan("");
  capture.exposures = 7;
  capture.dispersion = 0.5;
  capture.truth["y_m"] = 2.0;
  capture.T_world_sensor = Transform(Eigen::Translation3d(1, 2, 3));
  capture.relay_points.emplace(6, Eigen::Vector3d(0, 1, 2));
  export_npz(folder.file("a.npz"), written);

  std::vector<std::string> warnings;
  const CaptureFile read = import_captures({folder.file("a.npz")}, {}, &warnings);
  EXPECT_TRUE(warnings.empty());
  EXPECT_EQ(read.bin_width, written.bin_width);
  EXPECT_EQ(read.description, written.description);
  ASSERT_EQ(read.captures.size(), 3u);
  EXPECT_EQ(read.captures[0].counts.values, written.captures[0].counts.values);
  EXPECT_EQ(read.captures[1].counts.values[0], -0.1);
  EXPECT_TRUE(std::isnan(read.captures[1].counts.values[1]));
  EXPECT_EQ(read.captures[1].counts.columns, 3);
  EXPECT_EQ(read.captures[1].exposures, 7);
  EXPECT_EQ(read.captures[1].dispersion, 0.5);
  EXPECT_EQ(read.captures[1].truth, capture.truth);
  ASSERT_TRUE(read.captures[1].T_world_sensor.has_value());
  EXPECT_TRUE(read.captures[1].T_world_sensor->isApprox(*capture.T_world_sensor));
  EXPECT_EQ(read.captures[1].relay_points, capture.relay_points);
  EXPECT_EQ(read.captures[2].index, 2);
  EXPECT_EQ(read.captures[2].source, folder.file("a.npz"));
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(ExportTest, SameCapturesGiveSameBytes) {
  TemporaryFolder folder;
  export_npz(folder.file("a.npz"), make_captures(1, 2, 2, 4));
  export_npz(folder.file("b.npz"), make_captures(1, 2, 2, 4));
  EXPECT_EQ(read_text(folder.file("a.npz")), read_text(folder.file("b.npz")));
}

TEST(ExportTest, CsvHasALinePerCount) {
  TemporaryFolder folder;
  CaptureFile file = make_captures(2, 2, 1, 2);
  file.captures[1].counts.values = {0.1, -3.0, 1e20, std::nan("")};
  export_captures(folder.file("a.csv"), file);
  EXPECT_EQ(read_text(folder.file("a.csv")),
            "capture,zone,row,column,bin,count\n"
            "0,0,0,0,0,0\n0,0,0,0,1,0.25\n0,1,1,0,0,0.5\n0,1,1,0,1,0.75\n"
            "1,0,0,0,0,0.1\n1,0,0,0,1,-3\n1,1,1,0,0,1e+20\n1,1,1,0,1,nan\n");
}

// What a log holds comes back from the reader of logs, in every layout of zones.
TEST(ExportTest, LogsOfATmf8828ComeBack) {
  TemporaryFolder folder;
  for (const int side : {3, 4, 8}) {
    CaptureFile file = make_captures(2, side, side, 128);
    for (Capture& capture : file.captures) {
      double next = 0;  // up to three bytes
      for (double& count : capture.counts.values) count = std::fmod(next += 70001, 1 << 24);
    }
    export_captures(folder.file("a.log"), file);
    ImportOptions options;
    options.rows = options.columns = side;
    options.bin_width = 88e-12;
    const CaptureFile back = import_captures({folder.file("a.log")}, options);
    ASSERT_EQ(back.captures.size(), 2u) << side;
    EXPECT_EQ(back.captures[1].counts.values, file.captures[1].counts.values) << side;
  }
  CaptureFile half = make_captures(1, 3, 3, 128);
  half.captures[0].counts.values[5] = 0.5;
  EXPECT_THAT(error_of([&] { export_captures(folder.file("b.log"), half); }),
              AllOf(HasSubstr("b.log: capture 0"), HasSubstr("accepted: whole numbers")));
}

TEST(ExportTest, EndingChoosesTheFormat) {
  TemporaryFolder folder;
  export_captures(folder.file("a.npz"), make_captures(1, 1, 1, 2));
  EXPECT_EQ(import_captures({folder.file("a.npz")}).captures.size(), 1u);
  const std::string path = folder.file("a.mat");
  EXPECT_EQ(error_of([&] { export_captures(path, make_captures(1, 1, 1, 2)); }),
            path + ": ending is .mat, accepted .npz, .csv, .log and .hdf5");
  EXPECT_THAT(error_of([&] { export_captures(folder.file("b.npz"), CaptureFile{}); }),
              AllOf(StartsWith(folder.file("b.npz")), HasSubstr("no captures")));
  EXPECT_EQ(folder.entries(), 1u);
}

}  // namespace
}  // namespace blindcorner
