// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/capture_file.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <ImfTiledOutputFile.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "blindcorner/io/atomic_file.h"
#include "blindcorner/io/capture_text.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using test::error_of;
using test::make_captures;
using test::read_text;
using test::TemporaryFolder;
using test::write_text;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const char* const kMetadata =
    R"({"format":"blindcorner.capture/1","rows":1,"columns":2,"bins":3,"captures":[{}]})";

/// An EXR file as another program might have made it: zeros, 3 x 2 pixels unless stated.
struct ForeignImage {
  std::string channel = "Y";
  Imf::PixelType type = Imf::FLOAT;
  Imf::Compression compression = Imf::ZIP_COMPRESSION;
  int width = 3, height = 2;
  std::string metadata = kMetadata;
  bool with_metadata = true;
  bool tiled = false;

  void write(const std::string& path) const {
    Imf::Header header(width, height);
    header.compression() = compression;
    header.channels().insert(channel, Imf::Channel(type));
    if (with_metadata) header.insert("blindcorner", Imf::StringAttribute(metadata));
    if (tiled) header.setTileDescription(Imf::TileDescription(16, 16, Imf::ONE_LEVEL));
    std::vector<float> pixels(static_cast<std::size_t>(width * height));
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<float>(i);
    Imf::FrameBuffer buffer;
    const std::size_t size = type == Imf::HALF ? 2 : 4;
    buffer.insert(channel, Imf::Slice::Make(type, pixels.data(), header.dataWindow(), size,
                                            size * static_cast<std::size_t>(width)));
    if (tiled) {
      Imf::TiledOutputFile image(path.c_str(), header);
      image.setFrameBuffer(buffer);
      image.writeTiles(0, image.numXTiles() - 1, 0, image.numYTiles() - 1);
    } else {
      Imf::OutputFile image(path.c_str(), header);
      image.setFrameBuffer(buffer);
      image.writePixels(height);
    }
  }
};

class CaptureFileTest : public ::testing::Test {
 protected:
  std::string read_error(const std::string& path) {
    return error_of([&] { read_captures(path); });
  }
  /// Message for a file written with this metadata.
  std::string metadata_error(const std::string& metadata) {
    ForeignImage image;
    image.metadata = metadata;
    image.write(folder_.file("m.exr"));
    std::string message = read_error(folder_.file("m.exr"));
    EXPECT_THAT(message, StartsWith(folder_.file("m.exr")));
    test::keep_refused("capture", metadata, message);
    return message;
  }

  TemporaryFolder folder_;
};

TEST_F(CaptureFileTest, EverythingComesBack) {
  CaptureFile written = make_captures(3, 2, 3, 5);
  Capture& first = written.captures[0];
  first.exposures = 20;
  first.dispersion = 1.5;
  first.truth = {{"x_m", 0.3}, {"yaw_rad", -1.25}};
  first.T_world_sensor = Transform::Identity();
  first.T_world_sensor->linear() =
      Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, -2, 3).normalized()).toRotationMatrix();
  first.T_world_sensor->translation() = Eigen::Vector3d(0.459, 0.321, 0.373);
  first.relay_points.emplace();
  for (int z = 0; z < 6; ++z) first.relay_points->emplace_back(0.1 * z, 0.8, -0.3);
  written.captures[1].truth = {{"x_m", 7.0}};

  const std::string path = folder_.file("a.exr");
  write_captures(path, written);
  const CaptureFile read = read_captures(path);

  EXPECT_EQ(read.bin_width, written.bin_width);  // exactly: both are 88 ps
  EXPECT_EQ(read.sensor, "tmf8828");
  EXPECT_EQ(read.description, "made up");
  ASSERT_EQ(read.captures.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read.captures[i].counts.rows, 2);
    EXPECT_EQ(read.captures[i].counts.columns, 3);
    EXPECT_EQ(read.captures[i].counts.bins, 5);
    EXPECT_EQ(read.captures[i].counts.values, written.captures[i].counts.values);
    EXPECT_EQ(read.captures[i].source, path);
    EXPECT_EQ(read.captures[i].index, static_cast<int>(i));
    EXPECT_EQ(read.captures[i].truth, written.captures[i].truth);
  }
  const Capture& capture = read.captures[0];
  EXPECT_EQ(capture.exposures, 20);
  EXPECT_EQ(capture.dispersion, 1.5);
  ASSERT_TRUE(capture.T_world_sensor.has_value());
  EXPECT_TRUE(capture.T_world_sensor->isApprox(*first.T_world_sensor, 1e-14));
  ASSERT_TRUE(capture.relay_points.has_value());
  EXPECT_EQ(*capture.relay_points, *first.relay_points);
  EXPECT_EQ(read.captures[1].exposures, 1.0);
  EXPECT_FALSE(read.captures[1].dispersion.has_value());
  EXPECT_FALSE(read.captures[1].T_world_sensor.has_value());
  EXPECT_FALSE(read.captures[1].relay_points.has_value());
}

TEST_F(CaptureFileTest, NegativeNanInfiniteAndLargeValuesSurvive) {
  CaptureFile written = make_captures(1, 1, 1, 5);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  written.captures[0].counts.values = {-12.5, nan, -infinity, 16777216.0, 0.1};
  write_captures(folder_.file("a.exr"), written);
  const std::vector<double> read = read_captures(folder_.file("a.exr")).captures[0].counts.values;
  EXPECT_EQ(read[0], -12.5);
  EXPECT_TRUE(std::isnan(read[1]));
  EXPECT_EQ(read[2], -infinity);
  EXPECT_EQ(read[3], 16777216.0);
  EXPECT_EQ(read[4], static_cast<double>(0.1f));  // stored in single precision
}

TEST_F(CaptureFileTest, RelayPointsOfDeadZonesMayBeNan) {
  CaptureFile written = make_captures(1, 1, 2, 3);
  written.captures[0].relay_points = {Eigen::Vector3d::Constant(std::nan("")),
                                      Eigen::Vector3d::Zero()};
  write_captures(folder_.file("a.exr"), written);
  const auto points = read_captures(folder_.file("a.exr")).captures[0].relay_points;
  ASSERT_TRUE(points.has_value());
  EXPECT_TRUE((*points)[0].array().isNaN().all());
  EXPECT_EQ((*points)[1], Eigen::Vector3d::Zero());
}

TEST_F(CaptureFileTest, SameCapturesGiveSameBytes) {
  write_captures(folder_.file("a.exr"), make_captures(2, 3, 3, 8));
  write_captures(folder_.file("b.exr"), make_captures(2, 3, 3, 8));
  EXPECT_EQ(read_text(folder_.file("a.exr")), read_text(folder_.file("b.exr")));
}

TEST_F(CaptureFileTest, OtherProgramsSeeTheDocumentedImage) {
  write_captures(folder_.file("a.exr"), make_captures(4, 2, 3, 7));
  Imf::InputFile image(folder_.file("a.exr").c_str());
  EXPECT_EQ(image.header().dataWindow().max.x, 6);
  EXPECT_EQ(image.header().dataWindow().max.y, 4 * 6 - 1);
  ASSERT_NE(image.header().channels().findChannel("Y"), nullptr);
  EXPECT_EQ(image.header().channels().findChannel("Y")->type, Imf::FLOAT);
  EXPECT_EQ(image.header().compression(), Imf::ZIP_COMPRESSION);
  const auto* metadata = image.header().findTypedAttribute<Imf::StringAttribute>("blindcorner");
  ASSERT_NE(metadata, nullptr);
  EXPECT_THAT(metadata->value(), HasSubstr(R"("format":"blindcorner.capture/1")"));
  EXPECT_THAT(metadata->value(), HasSubstr(R"("bin_width_ps":88.0)"));
}

TEST_F(CaptureFileTest, FilesOfOtherProgramsAreReadWhenLossless) {
  for (const bool tiled : {false, true}) {
    for (const auto compression :
         {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::PIZ_COMPRESSION}) {
      ForeignImage image;
      image.tiled = tiled;
      image.compression = compression;
      image.write(folder_.file("f.exr"));
      const CaptureFile file = read_captures(folder_.file("f.exr"));
      ASSERT_EQ(file.captures.size(), 1u);
      EXPECT_EQ(file.captures[0].counts.values, (std::vector<double>{0, 1, 2, 3, 4, 5}));
      EXPECT_EQ(file.bin_width, 0.0);
    }
  }
}

// A truncated file must never be taken for a shorter or darker capture.
TEST_F(CaptureFileTest, EveryTruncationIsAnError) {
  const std::string whole = folder_.file("whole.exr");
  const std::string cut = folder_.file("cut.exr");
  write_captures(whole, make_captures(7, 3, 3, 64));
  const std::string bytes = read_text(whole);
  for (std::size_t length = 0; length < bytes.size(); length += length < 2000 ? 7 : 41) {
    write_text(cut, bytes.substr(0, length));
    EXPECT_THAT(read_error(cut), StartsWith(cut + ": ")) << length << " of " << bytes.size();
  }
  write_text(cut, bytes.substr(0, bytes.size() - 1));
  EXPECT_THAT(read_error(cut), StartsWith(cut + ": "));
}

// Whatever damage does, it must end in an Error or in a capture, not in a crash or in huge memory.
TEST_F(CaptureFileTest, DamagedBytesNeverCrash) {
  const std::string whole = folder_.file("whole.exr");
  const std::string damaged = folder_.file("damaged.exr");
  write_captures(whole, make_captures(2, 3, 3, 16));
  const std::string bytes = read_text(whole);
  for (std::size_t at = 4; at < bytes.size(); at += 3) {
    std::string copy = bytes;
    copy[at] = static_cast<char>(copy[at] ^ 0x55);
    write_text(damaged, copy);
    const std::string message = read_error(damaged);
    if (!message.empty()) {
      EXPECT_THAT(message, StartsWith(damaged + ": "));
    }
  }
}

// OpenEXR would read a second header, whose sizes may say anything, before it tells of several.
TEST_F(CaptureFileTest, SeveralPartsAreRefusedBeforeTheyAreRead) {
  const std::string path = folder_.file("parts.exr");
  write_captures(path, make_captures(1, 3, 3, 16));
  std::string bytes = read_text(path);
  bytes[5] = static_cast<char>(bytes[5] | 0x10);
  write_text(path, bytes);
  EXPECT_EQ(read_error(path), path + ": has several parts, accepted one");
}

TEST_F(CaptureFileTest, UnreadableFilesAreNamedWithTheReason) {
  EXPECT_EQ(read_error(folder_.file("none.exr")), folder_.file("none.exr") + ": no such file");
  EXPECT_EQ(read_error(folder_.path()), folder_.path() + ": is a directory, not a file");
  write_text(folder_.file("empty.exr"), "");
  EXPECT_EQ(read_error(folder_.file("empty.exr")), folder_.file("empty.exr") + ": is empty");
  write_text(folder_.file("text.exr"), "this is no image");
  EXPECT_THAT(read_error(folder_.file("text.exr")),
              AllOf(StartsWith(folder_.file("text.exr")), HasSubstr("is not an OpenEXR file")));
}

TEST_F(CaptureFileTest, UnsuitableImagesAreNamedWithTheReason) {
  const std::string path = folder_.file("f.exr");
  const auto message = [&](const ForeignImage& image) {
    image.write(path);
    std::string text = read_error(path);
    EXPECT_THAT(text, StartsWith(path + ": "));
    return text;
  };
  ForeignImage half, integer, red, bare, lossy, wide, high;
  half.type = Imf::HALF;
  EXPECT_THAT(message(half), AllOf(HasSubstr("channel Y"), HasSubstr("HALF"), HasSubstr("FLOAT")));
  integer.type = Imf::UINT;
  EXPECT_THAT(message(integer), AllOf(HasSubstr("UINT"), HasSubstr("FLOAT")));
  red.channel = "R";
  EXPECT_THAT(message(red), AllOf(HasSubstr("channel Y is missing"), HasSubstr("found R")));
  bare.with_metadata = false;
  EXPECT_THAT(message(bare), HasSubstr("attribute blindcorner is missing"));
  lossy.compression = Imf::PXR24_COMPRESSION;
  EXPECT_THAT(message(lossy), HasSubstr("lossy"));
  wide.width = 4;
  EXPECT_THAT(message(wide), AllOf(HasSubstr("4 pixels wide"), HasSubstr("3 bins")));
  high.height = 5;
  EXPECT_THAT(message(high), AllOf(HasSubstr("5 rows"), HasSubstr("2 rows")));
}

TEST_F(CaptureFileTest, WrongMetadataAreNamedByField) {
  EXPECT_THAT(metadata_error("{"), HasSubstr("found what is not JSON"));
  EXPECT_THAT(metadata_error("[]"), HasSubstr("an object"));
  EXPECT_THAT(metadata_error("{}"), HasSubstr("format: found nothing"));
  EXPECT_THAT(metadata_error(R"({"format":"other"})"),
              AllOf(HasSubstr("blindcorner: format"), HasSubstr("\"other\""),
                    HasSubstr("blindcorner.capture/1")));
  const std::string start = R"({"format":"blindcorner.capture/1","columns":2,"bins":3,)";
  EXPECT_THAT(metadata_error(start + R"("captures":[{}]})"), HasSubstr("rows: found nothing"));
  EXPECT_THAT(metadata_error(start + R"("rows":0,"captures":[{}]})"),
              AllOf(HasSubstr("rows: found 0"), HasSubstr("from 1")));
  EXPECT_THAT(metadata_error(start + R"("rows":1,"bin_width_ns":1,"captures":[{}]})"),
              AllOf(HasSubstr("bin_width_ns: found an unknown field"), HasSubstr("bin_width_ps")));
  EXPECT_THAT(metadata_error(start + R"("rows":1,"captures":[{"pose":0}]})"),
              AllOf(HasSubstr("captures[0].pose"), HasSubstr("sensor_pose")));
  EXPECT_THAT(metadata_error(start + R"("rows":1.5,"captures":[{}]})"), HasSubstr("rows"));
  EXPECT_THAT(metadata_error(start + R"("rows":1,"captures":[]})"), HasSubstr("captures: found"));
  EXPECT_THAT(metadata_error(start + R"("rows":1,"captures":7})"), HasSubstr("captures: found 7"));
  EXPECT_THAT(metadata_error(start + R"("rows":1,"bin_width_ps":-1,"captures":[{}]})"),
              HasSubstr("bin_width_ps: found -1"));
  const auto capture = [&](const std::string& json) {
    return metadata_error(start + R"("rows":1,"captures":[)" + json + "]}");
  };
  EXPECT_THAT(capture("3"), HasSubstr("captures[0]: found 3, accepted: an object"));
  EXPECT_THAT(capture(R"({"exposures":0})"), HasSubstr("captures[0].exposures: found 0"));
  EXPECT_THAT(capture(R"({"dispersion":null})"), HasSubstr("captures[0].dispersion: found null"));
  EXPECT_THAT(capture(R"({"truth":{"x_m":"far"}})"), HasSubstr("captures[0].truth.x_m"));
  EXPECT_THAT(capture(R"({"truth":[]})"), HasSubstr("captures[0].truth"));
  EXPECT_THAT(capture(R"({"truth":{"yaw_deg":3}})"),
              AllOf(HasSubstr("captures[0].truth.yaw_deg"), HasSubstr("yaw_rad")));
  EXPECT_THAT(capture(R"({"exposures":1,"exposures":2})"), HasSubstr("found twice"));
  EXPECT_THAT(capture(R"({"relay_points_m":[[null,0,0],[0,0,0]]})"),
              HasSubstr("relay_points_m[0][0]: found null"));
  EXPECT_THAT(capture(R"({"sensor_pose":{"position_m":[1e8,0,0],"quaternion_wxyz":[1,0,0,0]}})"),
              HasSubstr("position_m[0]"));
  EXPECT_THAT(
      capture(R"({"sensor_pose":{"position_m":[0,0,0],"quaternion_wxyz":[1,0,0,0],"yaw":1}})"),
      HasSubstr("sensor_pose.yaw: found an unknown field"));
  EXPECT_THAT(capture(R"({"relay_points_m":[[0,0,0]]})"),
              AllOf(HasSubstr("captures[0].relay_points_m"), HasSubstr("2 points")));
  EXPECT_THAT(capture(R"({"relay_points_m":[[0,0,0],[0,1]]})"), HasSubstr("relay_points_m[1]"));
  EXPECT_THAT(capture(R"({"sensor_pose":{"position_m":[0,0,0]}})"),
              HasSubstr("captures[0].sensor_pose.quaternion_wxyz: found nothing"));
  EXPECT_THAT(capture(R"({"sensor_pose":{"position_m":[0,0,0],"quaternion_wxyz":[0.5,0,0,0]}})"),
              AllOf(HasSubstr("quaternion_wxyz"), HasSubstr("of length 1")));
}

TEST_F(CaptureFileTest, WhatCannotBeStoredIsRefusedBeforeAnythingIsWritten) {
  const std::string path = folder_.file("a.exr");
  const auto message = [&](auto change) {
    CaptureFile file = make_captures(2, 1, 2, 3);
    change(file);
    std::string text = error_of([&] { write_captures(path, file); });
    EXPECT_THAT(text, StartsWith(path + ": "));
    return text;
  };
  EXPECT_THAT(message([](CaptureFile& f) { f.captures.clear(); }), HasSubstr("no captures"));
  EXPECT_THAT(message([](CaptureFile& f) {
                for (Capture& c : f.captures) c.counts = HistogramCube(1, 1, (1 << 20) + 1);
              }),
              HasSubstr("at most 1048576"));
  EXPECT_THAT(message([](CaptureFile& f) { f.captures[1].counts = HistogramCube(2, 1, 3); }),
              AllOf(HasSubstr("captures[1]"), HasSubstr("2 x 1 x 3"), HasSubstr("1 x 2 x 3")));
  EXPECT_THAT(message([](CaptureFile& f) { f.captures[1].counts.values.pop_back(); }),
              AllOf(HasSubstr("captures[1]"), HasSubstr("5 values")));
  EXPECT_THAT(message([](CaptureFile& f) { f.captures[0].exposures = -1; }),
              HasSubstr("captures[0].exposures"));
  EXPECT_THAT(message([](CaptureFile& f) { f.captures[0].dispersion = std::nan(""); }),
              HasSubstr("captures[0].dispersion"));
  EXPECT_THAT(message([](CaptureFile& f) { f.captures[0].truth["x_m"] = std::nan(""); }),
              HasSubstr("captures[0].truth.x_m"));
  EXPECT_THAT(message([](CaptureFile& f) { f.captures[0].relay_points.emplace(3); }),
              AllOf(HasSubstr("relay_points"), HasSubstr("3 points")));
  EXPECT_THAT(message([](CaptureFile& f) { f.captures[1].counts.values[0] = 1e300; }),
              HasSubstr("captures[1]"));
  EXPECT_THAT(message([](CaptureFile& f) { f.bin_width = -1e-12; }), HasSubstr("bin_width"));
  EXPECT_EQ(folder_.entries(), 0u);
}

TEST(AtomicFileTest, ReplacesAndLeavesNothingBeside) {
  TemporaryFolder folder;
  const std::string path = folder.file("a.txt");
  write_atomically(path, "first");
  write_atomically(path, std::string_view("second\0!", 8));
  EXPECT_EQ(read_text(path), std::string("second\0!", 8));
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(AtomicFileTest, FailuresNameTheFileAndLeaveNothing) {
  TemporaryFolder folder;
  const std::string lost = folder.file("no_such_folder/a.txt");
  EXPECT_THAT(error_of([&] { write_atomically(lost, "x"); }),
              AllOf(StartsWith(lost), HasSubstr("No such file")));
  EXPECT_THAT(error_of([&] { write_atomically(folder.path(), "x"); }),
              AllOf(StartsWith(folder.path()), HasSubstr("directory")));
  EXPECT_EQ(folder.entries(), 0u);
  // A device cannot be replaced by a file; a full one must be noticed.
  if (std::filesystem::exists("/dev/full")) {
    EXPECT_THAT(error_of([&] { write_atomically("/dev/full", "x"); }), HasSubstr("/dev/full"));
  }
}

TEST(CaptureTextTest, SaysWhatTheFileHolds) {
  CaptureFile file = make_captures(2, 1, 2, 8);
  file.captures[0].counts.values.assign(16, 0.0);
  file.captures[0].counts.values[3] = 8.0;  // zone 0, peak in bin 3
  file.captures[0].counts.values[4] = 4.0;
  file.captures[0].counts.values[8] = std::nan("");  // zone 1
  file.captures[0].counts.values[15] = -2.0;
  file.captures[0].exposures = 20;
  file.captures[1].truth["x_m"] = 0.5;
  const std::string text = describe(file);
  EXPECT_THAT(text, HasSubstr("2 captures of 1 x 2 zones x 8 bins of 88 ps"));
  EXPECT_THAT(text, HasSubstr("sensor: tmf8828"));
  EXPECT_THAT(text, HasSubstr("1 NaN, 0 infinite, 1 negative"));
  EXPECT_THAT(text, HasSubstr("exposures averaged: 1 to 20"));
  EXPECT_THAT(text, HasSubstr("truth x_m: 0.5 (1 of 2 captures)"));
  EXPECT_THAT(text, HasSubstr("     3            8     █▅   \n"));
  EXPECT_THAT(text, HasSubstr("?       \n"));
  DescribeOptions pooled;
  pooled.width = 4;
  EXPECT_THAT(describe(file, pooled), HasSubstr("   █▅ \n"));
  DescribeOptions none;
  none.capture = -1;
  EXPECT_THAT(describe(file, none), ::testing::Not(HasSubstr("histogram")));
  DescribeOptions missing;
  missing.capture = 2;
  EXPECT_EQ(error_of([&] { describe(file, missing); }), "capture: found 2, accepted 0 to 1");
}

}  // namespace
}  // namespace blindcorner
