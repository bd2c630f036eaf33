// SPDX-License-Identifier: Apache-2.0
/// Files that promise more than they hold, or nest without end: each is refused with one line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "blindcorner/io/import_file.h"
#include "blindcorner/io/scene_file.h"
#include "io/json_depth.h"
#include "io/matlab_check.h"
#include "io/mesh_file.h"
#include "io/npz.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using test::error_of;
using testing::AllOf;
using testing::HasSubstr;

TEST(JsonDepth, CountsWhatIsOpenOutsideOfStrings) {
  const auto nested = [](int depth) {
    return std::string(static_cast<std::size_t>(depth), '[') +
           std::string(static_cast<std::size_t>(depth), ']');
  };
  EXPECT_EQ(error_of([&] { check_json_depth(nested(kDeepestJson), "f"); }), "");
  EXPECT_THAT(error_of([&] { check_json_depth(nested(kDeepestJson + 1), "f"); }),
              AllOf(HasSubstr("f: "), HasSubstr("nested deeper than 64")));
  EXPECT_EQ(error_of([&] { check_json_depth(R"({"a\"": ")" + nested(100) + "\"}", "f"); }), "");
}

TEST(JsonDepth, ScenesNestedDeepAreRefused) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("scene.json");
  test::write_text(path, R"({"name": )" + std::string(100'000, '['));
  EXPECT_THAT(error_of([&] { read_scene(path); }),
              AllOf(HasSubstr("scene.json"), HasSubstr("nested deeper")));
}

TEST(Exr, AttributesLargerThanTheFileAreRefused) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("c.exr");
  write_captures(path, test::make_captures(1, 1, 1, 4));
  std::string bytes = test::read_text(path);
  // The size of the attribute that holds the metadata.
  const std::string name("blindcorner\0string\0", 19);
  const std::size_t at = bytes.find(name) + name.size();
  for (const char top : {'\x69', '\xff'}) {
    bytes[at + 3] = top;
    test::write_text(path, bytes);
    EXPECT_THAT(error_of([&] { read_captures(path); }),
                AllOf(HasSubstr("c.exr"), HasSubstr("an attribute of"), HasSubstr("accepted")));
  }
}

TEST(Exr, AttributesOfAnotherSizeThanTheirTypesAreRefused) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("c.exr");
  write_captures(path, test::make_captures(1, 1, 1, 4));
  const std::string good = test::read_text(path);
  // The list of channels ends before its own end: all that follows would be read shifted.
  for (const std::string& name :
       {std::string("channels\0chlist\0", 16), std::string("compression\0compression\0", 24)}) {
    std::string bytes = good;
    ++bytes[bytes.find(name) + name.size()];
    test::write_text(path, bytes);
    EXPECT_THAT(error_of([&] { read_captures(path); }), HasSubstr("found an attribute of type"));
  }
}

TEST(Exr, MorePixelsThanTheFileCanHoldAreRefused) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("c.exr");
  write_captures(path, test::make_captures(1, 1, 1, 4));
  const std::string good = test::read_text(path);
  const std::string name("dataWindow\0box2i\0", 17);
  const std::size_t box = good.find(name) + name.size() + 4;
  for (const std::size_t byte : {11U, 15U}) {  // the highest of the greatest x and y
    std::string bytes = good;
    bytes[box + byte] = '\x01';
    test::write_text(path, bytes);
    EXPECT_THAT(error_of([&] { read_captures(path); }), HasSubstr("declares more pixels"));
  }
}

TEST(Obj, IsReadToTheLetter) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("m.obj");
  const auto message = [&](const std::string& vertex, const std::string& face) {
    test::write_text(path, "v 0 0 0\nv 1 0 0\nv " + vertex + "\nf " + face + "\n");
    return error_of([&] { read_obj(path, 1); });
  };
  EXPECT_EQ(message("0 1 0", "1 2 3"), "");
  EXPECT_EQ(message("0 1e0 0 1", "1/1 2//3 -1"), "");
  EXPECT_EQ(message("+0 .1 0 # note", "1 2 3 # note"), "");
  EXPECT_THAT(message("0x10 1 0", "1 2 3"), HasSubstr("m.obj: line 3: found"));
  // Lines that end with a carriage return alone.
  test::write_text(path, "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r");
  EXPECT_EQ(read_obj(path, 1)->triangles.size(), 1u);
  for (const char* vertex : {"nan 1 0", "0 inf 0", "0 one 0", "0 1", "0 1x 0"}) {
    EXPECT_THAT(message(vertex, "1 2 3"), HasSubstr("m.obj: line 3: found")) << vertex;
  }
  for (const char* face : {"1 2 4", "1 2 0", "1 2 x", "1 2 99999999999999999999", "-4 1 2"}) {
    EXPECT_THAT(message("0 1 0", face), HasSubstr("m.obj: line 4: found")) << face;
  }
}

TEST(Obj, TooManyTrianglesAreRefused) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("m.obj");
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  std::string polygon = text + "f";
  for (int i = 0; i < 5003; ++i) polygon += " 1";
  test::write_text(path, polygon + "\n");
  EXPECT_THAT(error_of([&] { read_obj(path, 1); }), HasSubstr("found more than 5000 triangles"));
  for (int i = 0; i < 5001; ++i) text += "f 1 2 3\n";
  test::write_text(path, text);
  EXPECT_THAT(error_of([&] { read_obj(path, 1); }), HasSubstr("found more than 5000 triangles"));
}

// An array of nothing but zeros packs to a thousandth, which is honest; as bytes, numbers of it
// would take eight times as much.
TEST(Npz, ThatGrowsFarBeyondItsSizeIsRefused) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("zeros.npz");
  constexpr std::size_t kCount = std::size_t{12} << 20;
  const std::string zeros = npy_of({kCount}, std::vector<double>(kCount));
  test::write_text(path, npz_of({{"counts", zeros}}));
  EXPECT_EQ(NpzFile(path).read("counts").values.size(), kCount);
  std::string bytes = zeros;  // "<f8" to "|u1", with eight times as many
  bytes.replace(bytes.find("<f8"), 3, "|u1");
  const std::string count = std::to_string(kCount);
  const std::string more = std::to_string(8 * kCount);
  bytes.replace(bytes.find(count), count.size(), more);
  bytes.erase(bytes.find('}') + 1, more.size() - count.size());  // of the blanks that fill the head
  test::write_text(path, npz_of({{"counts", bytes}}));
  EXPECT_THAT(error_of([&] { NpzFile(path).read("counts"); }),
              AllOf(HasSubstr("zeros.npz: array counts"), HasSubstr("accepted: at most")));
}

TEST(Scene, TooManyZonesAndPriorsBeyondReasonAreRefused) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("scene.json");
  const auto message = [&](const std::string& sensor, const std::string& median) {
    test::write_text(path, R"({"name": "s", "sensor": {"fov_deg": [30, 30], "bin_width_ps": 100,
      "impulse_response": {"type": "gaussian", "fwhm_ps": 250},
      "illumination": {"mode": "flash", "field": {"fov_deg": [30, 30]}}, )" +
                               sensor + R"(},
      "sensor_pose": {"position_m": [0, 0, 1], "look": [1, 0, 0]},
      "surfaces": [{"name": "wall", "shape": "rectangle", "center_m": [0.6, 0, 1],
        "normal": [-1, 0, 0], "width_m": 3, "height_m": 2, "albedo": 0.7, "relay": true}],
      "hidden": {"name": "plate", "shape": "rectangle", "width_m": 0.2, "height_m": 0.2,
        "material": "lambertian", "albedo": 0.8, "position_m": [0.2, 0.5, 1], "yaw_deg": -20},
      "unknowns": {"x_m": [0.1, 0.3]},
      "linear": {"amplitude": {"prior": {"median": )" +
                               median + "}}}}");
    return error_of([&] { read_scene(path); });
  };
  EXPECT_THAT(message(R"("rows": 128, "columns": 128, "bins": 128)", "1"),
              AllOf(HasSubstr("sensor.rows"), HasSubstr("16384 zones")));
  EXPECT_THAT(message(R"("rows": 64, "columns": 64, "bins": 65536)", "1"),
              AllOf(HasSubstr("sensor.bins"), HasSubstr("accepted: at most 4194304")));
  EXPECT_THAT(message(R"("rows": 1, "columns": 1, "bins": 128)", "1e300"),
              HasSubstr("linear.amplitude.prior.median"));
}

/// A MATLAB 5 file of one array whose sizes and data are as told; class 6 is doubles.
std::string matlab_file(const std::vector<std::int32_t>& sizes, std::size_t numbers,
                        std::uint32_t array_class = 6) {
  const auto word = [](std::uint32_t value) {
    std::string bytes(4, '\0');
    std::memcpy(bytes.data(), &value, 4);
    return bytes;
  };
  std::string array = word(6) + word(8) + word(array_class) + word(0);  // flags
  array += word(5) + word(static_cast<std::uint32_t>(4 * sizes.size()));
  for (const std::int32_t size : sizes) array += word(static_cast<std::uint32_t>(size));
  if (sizes.size() % 2 == 1) array += word(0);
  array += word((1U << 16) | 1U) + std::string("a\0\0\0", 4);  // name
  array += word(9) + word(static_cast<std::uint32_t>(8 * numbers)) + std::string(8 * numbers, '\0');
  std::string header(128, ' ');
  header[124] = 0;
  header[125] = 1;
  header.replace(126, 2, "IM");
  return header + word(14) + word(static_cast<std::uint32_t>(array.size())) + array;
}

TEST(Matlab, SizesBeyondTheDataAreRefused) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("m.mat");
  const auto message = [&](const std::string& bytes) {
    test::write_text(path, bytes);
    return error_of([&] { check_matlab_file(path); });
  };
  EXPECT_EQ(message(matlab_file({2, 3}, 6)), "");
  EXPECT_EQ(message(matlab_file({2, 2, 3}, 12)), "");
  EXPECT_THAT(message(matlab_file({2, 4}, 6)),
              HasSubstr("m.mat: found an array of 8 numbers that holds 6"));
  EXPECT_THAT(message(matlab_file({100'000, 100'000}, 6)), HasSubstr("more than 2^31"));
  EXPECT_THAT(message(matlab_file({-1, 6}, 6)), HasSubstr("a negative size"));
  std::vector<std::int32_t> beyond_doubles(40, std::numeric_limits<std::int32_t>::max());
  beyond_doubles.push_back(0);
  EXPECT_THAT(message(matlab_file(beyond_doubles, 6)), HasSubstr("more than 2^31"));
  EXPECT_EQ(message(matlab_file({2, 3}, 6, 4)), "") << "text";
  EXPECT_THAT(message(matlab_file({2, 4}, 6, 4)), HasSubstr("8 numbers that holds 6"));
  for (const std::uint32_t other : {2U, 3U, 5U, 16U}) {  // structure, object, sparse, function
    EXPECT_THAT(message(matlab_file({2, 3}, 6, other)), HasSubstr("a sparse array, a structure"));
  }
  const std::string whole = matlab_file({2, 3}, 6);
  for (std::size_t size = 1; size < whole.size(); ++size) {
    EXPECT_NE(message(whole.substr(0, size)), "") << size;
  }
}

}  // namespace
}  // namespace blindcorner
