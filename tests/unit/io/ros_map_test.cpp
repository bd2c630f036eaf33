// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/ros_map.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "io/grey_image.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using test::error_of;
using test::TemporaryFolder;
using test::write_text;
using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kHead = "resolution: 0.05\norigin: [-10.0, 2.5, 0.0]\n";

std::string yaml(const std::string& image, const std::string& mode, int negate) {
  return "image: " + image + "\nmode: " + mode + "\n" + kHead +
         "negate: " + std::to_string(negate) + "\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
}

/// One row of pixels read as a map.
std::vector<int> read_row(const std::vector<std::uint8_t>& grey,
                          const std::vector<std::uint8_t>& alpha, const std::string& mode,
                          int negate) {
  const TemporaryFolder folder;
  const int width = static_cast<int>(grey.size());
  const std::string name = alpha.empty() ? "m.pgm" : "m.png";
  write_text(folder.file(name),
             alpha.empty() ? pgm_bytes(width, 1, grey) : png_bytes(width, 1, grey, alpha));
  write_text(folder.file("m.yaml"), yaml(name, mode, negate));
  const RosMap map = read_ros_map(folder.file("m.yaml"));
  return {map.cells.begin(), map.cells.end()};
}

// By hand from map_server's rules: occ = (255 - grey) / 255, occupied above 0.65, free below 0.196.
//   0: 1        89: 0.65098    90: 0.64706    205: 0.19608    206: 0.19216    254: 0.00392
TEST(RosMap, TrinaryAsMapServer) {
  const std::vector<std::uint8_t> grey{0, 89, 90, 128, 205, 206, 254, 255};
  EXPECT_EQ(read_row(grey, {}, "trinary", 0), (std::vector<int>{100, 100, -1, -1, -1, 0, 0, 0}));
  // negate: occ = grey / 255. 128: 0.50196; 205: 0.80392.
  EXPECT_EQ(read_row(grey, {}, "trinary", 1),
            (std::vector<int>{0, -1, -1, -1, 100, 100, 100, 100}));
  // Alpha is a fourth channel: black and opaque is (0 + 0 + 0 + 255) / 4 = 63.75, occ 0.75; 60 and
  // opaque is 108.75, occ 0.574; white and transparent is 191.25, occ 0.25.
  EXPECT_EQ(read_row({0, 60, 255, 255}, {255, 255, 0, 255}, "trinary", 0),
            (std::vector<int>{100, -1, -1, 0}));
}

// (occ - 0.196) / 0.454 * 100, rounded. 90: 99.35; 128: 0.49804 -> 66.53; 150: 0.41176 -> 47.53;
// 205: 0.0173 -> 0.02.
TEST(RosMap, ScaleAsMapServer) {
  EXPECT_EQ(read_row({0, 89, 90, 128, 150, 205, 206, 255}, {}, "scale", 0),
            (std::vector<int>{100, 100, 99, 67, 48, 0, 0, 0}));
  // 127 negated: 0.49804. What is not opaque is unknown.
  EXPECT_EQ(read_row({127, 255, 255, 0}, {255, 255, 254, 0}, "scale", 1),
            (std::vector<int>{67, 100, -1, -1}));
}

TEST(RosMap, RawAsMapServer) {
  const std::vector<std::uint8_t> grey{0, 1, 50, 100, 101, 205, 255};
  const std::vector<int> want{0, 1, 50, 100, -1, -1, -1};
  EXPECT_EQ(read_row(grey, {}, "raw", 0), want);
  EXPECT_EQ(read_row(grey, {}, "raw", 1), want);
}

TEST(RosMap, TheTopRowIsTheHighest) {
  const TemporaryFolder folder;
  write_text(folder.file("m.pgm"), "P2 # by hand\n2 3\n255\n0 254\n205 205\n254 0\n");
  write_text(folder.file("m.yaml"), yaml("m.pgm", "trinary", 0));
  const RosMap map = read_ros_map(folder.file("m.yaml"));
  EXPECT_EQ(map.geometry.columns, 2);
  EXPECT_EQ(map.geometry.rows, 3);
  EXPECT_EQ(map.geometry.cell_size, 0.05);
  EXPECT_EQ(map.geometry.origin, Eigen::Vector2d(-10, 2.5));
  EXPECT_EQ(map.at({0, 2}), 100);
  EXPECT_EQ(map.at({1, 2}), 0);
  EXPECT_EQ(map.at({0, 1}), -1);
  EXPECT_EQ(map.at({0, 0}), 0);
  EXPECT_EQ(map.at({1, 0}), 100);
}

RosMap every_value() {
  RosMap map{{.columns = 17, .rows = 6, .cell_size = 0.1, .origin = {-1.1, 1.0 / 3}}, {}};
  map.cells.resize(102);
  std::iota(map.cells.begin(), map.cells.end(), static_cast<std::int8_t>(-1));
  return map;
}

TEST(RosMap, WhatIsWrittenLoadsBackTheSame) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a map: #1.yaml");
  for (const MapMode mode : {MapMode::trinary, MapMode::scale, MapMode::raw}) {
    for (const bool negate : {false, true}) {
      for (const bool png : {false, true}) {
        const RosMapOptions options{.mode = mode, .png = png, .negate = negate};
        const RosMap map = every_value();
        write_ros_map(path, map, options);
        const RosMap back = read_ros_map(path);
        const std::vector<int> written(map.cells.begin(), map.cells.end());
        EXPECT_EQ(back.geometry.origin, map.geometry.origin);
        EXPECT_EQ(back.geometry.cell_size, map.geometry.cell_size);
        for (std::size_t i = 0; i < map.cells.size(); ++i) {
          int want = written[i];
          if (mode == MapMode::trinary && want >= 0) want = want <= 20 ? 0 : want >= 65 ? 100 : -1;
          ASSERT_EQ(back.cells[i], want) << static_cast<int>(mode) << negate << png;
        }
        write_ros_map(path, back, options);
        EXPECT_EQ(read_ros_map(path).cells, back.cells);
      }
    }
  }
  EXPECT_EQ(folder.entries(), 3U);  // yaml, pgm and png, nothing temporary
}

TEST(RosMap, WritesWhatMapSaverWrites) {
  const TemporaryFolder folder;
  RosMap map{{.columns = 3, .rows = 1, .cell_size = 0.05, .origin = {-10, 2.5}}, {0, 100, -1}};
  write_ros_map(folder.file("m.yaml"), map);
  EXPECT_EQ(test::read_text(folder.file("m.pgm")), std::string("P5\n3 1\n255\n\xfe\x00\xcd", 14));
  EXPECT_EQ(test::read_text(folder.file("m.yaml")),
            "image: m.pgm\nmode: trinary\nresolution: 0.05\norigin: [-10, 2.5, 0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.196\n");
}

TEST(RosMap, OfAGridAndBack) {
  OccupancyGrid grid({.columns = 3, .rows = 1, .cell_size = 0.5, .origin = {0, 0}});
  LineOfSightScan scan;
  scan.free = {0};
  scan.surface_hits = {1};
  for (int i = 0; i < 4; ++i) grid.update(0.1, &scan, nullptr);
  EXPECT_EQ(ros_map(grid).cells, (std::vector<std::int8_t>{0, 100, -1}));

  const RosMap map = every_value();
  EXPECT_EQ(ros_map(occupancy_grid(map)).cells, map.cells);
}

TEST(RosMap, SixteenBitsAndColours) {
  const TemporaryFolder folder;
  write_text(folder.file("m.pgm"), std::string("P5 2 1 1000\n\x03\xe8\x00\x00", 16));
  write_text(folder.file("m.yaml"), yaml("m.pgm", "trinary", 0));
  EXPECT_EQ(read_ros_map(folder.file("m.yaml")).cells, (std::vector<std::int8_t>{0, 100}));
}

/// A map of 3 x 2 cells of a metre, turned by `yaw` about (10, 20); from the lower row: free,
/// occupied, free; unknown, free, free.
RosMap turned_map(const std::string& yaw) {
  const TemporaryFolder folder;
  write_text(folder.file("m.pgm"), "P2\n3 2\n255\n205 254 254\n254 0 254\n");
  write_text(folder.file("m.yaml"),
             "image: m.pgm\nresolution: 1\norigin: [10, 20, " + yaw +
                 "]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n");
  return read_ros_map(folder.file("m.yaml"));
}

TEST(RosMap, AQuarterTurnMeetsItsCells) {
  const RosMap map = turned_map("1.5707963267948966");
  EXPECT_EQ(map.geometry.columns, 2);
  EXPECT_EQ(map.geometry.rows, 3);
  EXPECT_NEAR(map.geometry.origin.x(), 8, 1e-9);
  EXPECT_NEAR(map.geometry.origin.y(), 20, 1e-9);
  // The image's lower row goes up along the right edge.
  EXPECT_EQ(map.cells, (std::vector<std::int8_t>{-1, 0, 0, 100, 0, 0}));
}

TEST(RosMap, TurnedWallsStayClosedAndCornersAreUnknown) {
  const TemporaryFolder folder;
  std::string pixels = "P2\n21 21\n255\n";
  for (int i = 0; i < 21 * 21; ++i) pixels += i / 21 == 10 ? "0 " : "254 ";  // a wall of one cell
  write_text(folder.file("m.pgm"), pixels);
  write_text(folder.file("m.yaml"),
             "image: m.pgm\nresolution: 0.5\norigin: [0, 0, 0.6]\nnegate: 0\n"
             "occupied_thresh: 0.65\nfree_thresh: 0.196\n");
  const RosMap map = read_ros_map(folder.file("m.yaml"));
  const Eigen::Rotation2Dd turn(0.6);
  for (double along = 0.3; along < 10.2; along += 0.05) {
    const Eigen::Vector2d place = turn * Eigen::Vector2d(along, 5.25);
    EXPECT_EQ(map.cells[map.geometry.index(map.geometry.cell_at(place))], 100) << along;
    const Eigen::Vector2d clear = turn * Eigen::Vector2d(along, 2.0);
    EXPECT_EQ(map.cells[map.geometry.index(map.geometry.cell_at(clear))], 0) << along;
  }
  EXPECT_EQ(map.cells.front(), RosMap::kUnknown);
}

/// A bmp of `bits` a pixel: 2 x 2, the top row black and white, the lower one white and black.
std::string bmp(int bits) {
  const auto word = [](std::uint32_t value, int size) {
    std::string bytes;
    for (int i = 0; i < size; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xff);
    return bytes;
  };
  const std::string palette = bits <= 8 ? std::string("\0\0\0\0\xff\xff\xff\0", 8) : "";
  std::string pixels;
  for (const bool top : {false, true}) {  // the lowest row first
    std::string row;
    for (const bool right : {false, true}) {
      const bool white = right == top;
      if (bits == 1 && !right) row += static_cast<char>(white ? 0x80 : 0);
      if (bits == 1 && right) row[0] = static_cast<char>(row[0] | (white ? 0x40 : 0));
      if (bits == 8) row += static_cast<char>(white ? 1 : 0);
      if (bits >= 24) row += std::string(static_cast<std::size_t>(bits / 8), white ? '\xff' : '\0');
    }
    row.resize((row.size() + 3) / 4 * 4);
    pixels += row;
  }
  const auto start = static_cast<std::uint32_t>(54 + palette.size());
  return "BM" + word(start + static_cast<std::uint32_t>(pixels.size()), 4) + word(0, 4) +
         word(start, 4) + word(40, 4) + word(2, 4) + word(2, 4) + word(1, 2) +
         word(static_cast<std::uint32_t>(bits), 2) + std::string(24, '\0') + palette + pixels;
}

TEST(RosMap, Bitmaps) {
  const TemporaryFolder folder;
  write_text(folder.file("m.yaml"), yaml("m.bmp", "trinary", 0));
  for (const int bits : {1, 8, 24, 32}) {
    write_text(folder.file("m.bmp"), bmp(bits));
    EXPECT_EQ(read_ros_map(folder.file("m.yaml")).cells, (std::vector<std::int8_t>{0, 100, 100, 0}))
        << bits;
  }
  const std::string good = bmp(24);
  for (std::size_t length = 2; length < good.size(); length += 7) {
    write_text(folder.file("m.bmp"), good.substr(0, length));
    EXPECT_THAT(error_of([&] { read_ros_map(folder.file("m.yaml")); }), HasSubstr("m.bmp: "));
  }
  write_text(folder.file("m.bmp"), std::string(good).replace(30, 1, "\1"));
  EXPECT_THAT(error_of([&] { read_ros_map(folder.file("m.yaml")); }), HasSubstr("compression 1"));
}

TEST(RosMap, RefusesWithOneLine) {
  const TemporaryFolder folder;
  const std::string path = folder.file("m.yaml");
  write_text(folder.file("m.pgm"), "P2\n1 1\n255\n0\n");
  const auto refusal = [&](const std::string& text) {
    write_text(path, text);
    std::string message = error_of([&] { read_ros_map(path); });
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    return message;
  };
  const std::string good = yaml("m.pgm", "trinary", 0);
  EXPECT_EQ(refusal(good), "");
  const auto with = [&](const std::string& from, const std::string& to) {
    return std::string(good).replace(good.find(from), from.size(), to);
  };
  EXPECT_THAT(refusal(with("trinary", "binary")),
              AllOf(HasSubstr("m.yaml: mode: found binary"), HasSubstr("trinary, scale or raw")));
  EXPECT_THAT(refusal(with("resolution: 0.05", "resolution: -1")),
              HasSubstr("resolution: found -1"));
  EXPECT_THAT(refusal(with("resolution: 0.05", "resolution: .nan")), HasSubstr("resolution"));
  EXPECT_THAT(refusal(with("resolution: 0.05\n", "")), HasSubstr("resolution: found nothing"));
  EXPECT_THAT(refusal(with("0.0]", ".nan]")), HasSubstr("[x, y, yaw]"));
  EXPECT_THAT(refusal(with("negate: 0", "negate: 2")), HasSubstr("negate: found 2"));
  EXPECT_THAT(refusal(with(", 0.0]", "]")), HasSubstr("[x, y, yaw]"));
  EXPECT_THAT(refusal(with("negate: 0", "negate: maybe")), HasSubstr("negate: found maybe"));
  EXPECT_THAT(refusal(with("0.196", "0.7")), HasSubstr("less than occupied_thresh, 0.65"));
  // Equal ones leave no room for scale's proportion.
  EXPECT_THAT(refusal(with("0.196", "0.65")), HasSubstr("less than occupied_thresh, 0.65"));
  EXPECT_THAT(refusal(with("image: m.pgm", "image: ''")), HasSubstr("image"));
  EXPECT_THAT(refusal(with("m.pgm", "none.pgm")), HasSubstr("none.pgm: no such file"));
  EXPECT_THAT(refusal("a: [1\nb"), HasSubstr("is no yaml"));
  EXPECT_THAT(refusal("just words"), HasSubstr("found no keys"));
  EXPECT_EQ(refusal(with("mode: trinary\n", "")), "");
  EXPECT_EQ(refusal(with("negate: 0", "negate: false")), "");

  write_text(path, good);
  const auto of_image = [&](const std::string& bytes) {
    write_text(folder.file("m.pgm"), bytes);
    return error_of([&] { read_ros_map(path); });
  };
  EXPECT_THAT(of_image("P5 4 4 255\nabc"), HasSubstr("pixels: found 3 bytes, accepted: 16"));
  EXPECT_THAT(of_image("P2 1 1 255\n300"), HasSubstr("pixel: found 300"));
  EXPECT_THAT(of_image("P2 1 0 255\n"), HasSubstr("height"));
  EXPECT_THAT(of_image("P5 16777216 16777216 255\n"), HasSubstr("2^27"));
  EXPECT_THAT(of_image("P6 1 1 255\nabc"), HasSubstr("neither a pgm"));
  EXPECT_THAT(of_image("\x89PNG\r\n"), HasSubstr("png"));
}

TEST(RosMap, RefusesToWriteWhatCannotBeRead) {
  const TemporaryFolder folder;
  RosMapOptions options{.mode = MapMode::scale, .occupied_thresh = 0.3, .free_thresh = 0.25};
  EXPECT_THROW(write_ros_map(folder.file("m.yaml"), every_value(), options), Error);
  options.free_thresh = 0.4;
  EXPECT_THROW(write_ros_map(folder.file("m.yaml"), every_value(), options), Error);
  RosMap short_map = every_value();
  short_map.cells.pop_back();
  EXPECT_THROW(write_ros_map(folder.file("m.yaml"), short_map), Error);
  RosMap wrong = every_value();
  wrong.cells[0] = 101;
  EXPECT_THROW(write_ros_map(folder.file("m.yaml"), wrong), Error);
  EXPECT_EQ(folder.entries(), 0U);
  // The first two are endings of images, which the yaml file would overwrite.
  for (const char* name : {"m.pgm", "m.png", "m", "m.yaml.txt"}) {
    EXPECT_THAT(error_of([&] { write_ros_map(folder.file(name), every_value()); }),
                HasSubstr("a path that ends in .yaml or .yml"))
        << name;
  }
  write_ros_map(folder.file("short.yml"), every_value());
  EXPECT_EQ(read_ros_map(folder.file("short.yml")).cells.size(), every_value().cells.size());
}

}  // namespace
}  // namespace blindcorner
