// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/import_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zip.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/io/export_file.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using test::error_of;
using test::npy_bytes;
using test::raw_bytes;
using test::read_text;
using test::TemporaryFolder;
using test::write_text;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

/// A .npz of members written by hand.
void write_npz(const std::string& path,
               const std::vector<std::pair<std::string, std::string>>& members) {
  int code = 0;
  zip_t* archive = zip_open(path.c_str(), ZIP_CREATE | ZIP_TRUNCATE, &code);
  ASSERT_NE(archive, nullptr);
  for (const auto& [name, bytes] : members) {
    zip_source_t* source = zip_source_buffer(archive, bytes.data(), bytes.size(), 0);
    ASSERT_GE(zip_file_add(archive, (name + ".npy").c_str(), source, 0), 0);
  }
  ASSERT_EQ(zip_close(archive), 0);
}

/// Little-endian float64 data 0, 1, 2, ...
std::string counting(int count) {
  std::string data;
  for (int i = 0; i < count; ++i) data += raw_bytes(static_cast<double>(i));
  return data;
}

class ImportTest : public ::testing::Test {
 protected:
  std::string npy(const std::string& bytes) {
    std::string path = folder_.file("a.npy");
    write_text(path, bytes);
    return path;
  }
  static ImportOptions with_axes(const std::string& axes) {
    ImportOptions options;
    options.axes = axes;
    return options;
  }
  /// Values of a one-dimensional array.
  std::vector<double> values(const std::string& bytes) {
    return import_captures({npy(bytes)}, with_axes("bin")).captures.at(0).counts.values;
  }
  static std::string import_error(const std::string& path, const ImportOptions& options = {}) {
    return error_of([&] { import_captures({path}, options); });
  }
  /// Message for bytes of a .npy file, which has to begin with the file's name.
  std::string npy_error(const std::string& bytes, const std::string& axes = "bin") {
    const std::string path = npy(bytes);
    std::string message = import_error(path, with_axes(axes));
    EXPECT_THAT(message, StartsWith(path + ": "));
    return message;
  }

  TemporaryFolder folder_;
};

// ---- .npy ----

TEST_F(ImportTest, AllElementTypes) {
  EXPECT_THAT(values(npy_bytes("|u1", "(2,)", "\x07\xff")), ElementsAre(7, 255));
  EXPECT_THAT(values(npy_bytes("|i1", "(2,)", "\x07\xff")), ElementsAre(7, -1));
  for (const bool big : {false, true}) {
    const std::string order = big ? ">" : "<";
    const auto two = [&](const std::string& type, std::uint64_t a, std::uint64_t b, int size) {
      return values(
          npy_bytes(order + type, "(2,)", raw_bytes(a, size, big) + raw_bytes(b, size, big)));
    };
    EXPECT_THAT(two("u2", 258, 65535, 2), ElementsAre(258, 65535));
    EXPECT_THAT(two("i2", 258, 65535, 2), ElementsAre(258, -1));
    EXPECT_THAT(two("u4", 300000, 4294967295u, 4), ElementsAre(300000, 4294967295.0));
    EXPECT_THAT(two("i4", 300000, 4294967295u, 4), ElementsAre(300000, -1));
    EXPECT_THAT(two("u8", 1, std::uint64_t{1} << 63, 8), ElementsAre(1, std::ldexp(1.0, 63)));
    EXPECT_THAT(two("i8", 1, ~std::uint64_t{0}, 8), ElementsAre(1, -1));
    // 1.5 and the smallest subnormal; -65504 is the largest half.
    EXPECT_THAT(two("f2", 0x3e00, 0x0001, 2), ElementsAre(1.5, std::ldexp(1.0, -24)));
    EXPECT_THAT(two("f2", 0xfbff, 0x7c00, 2), ElementsAre(-65504, HUGE_VAL));
    EXPECT_THAT(two("f4", std::bit_cast<std::uint32_t>(-2.25f), 0, 4), ElementsAre(-2.25, 0));
    EXPECT_THAT(two("f8", std::bit_cast<std::uint64_t>(0.1), 0, 8), ElementsAre(0.1, 0));
    EXPECT_TRUE(std::isnan(two("f2", 0x7e00, 0, 2)[0]));
    EXPECT_TRUE(std::isnan(two("f4", 0x7fc00000, 0, 4)[0]));
  }
}

TEST_F(ImportTest, HeaderVersionsOneToThree) {
  for (const int version : {1, 2, 3}) {
    EXPECT_THAT(values(npy_bytes("|u1", "(2,)", "\x01\x02", false, version)), ElementsAre(1, 2));
  }
  EXPECT_THAT(npy_error(npy_bytes("|u1", "(2,)", "\x01\x02", false, 4)), HasSubstr("version is 4"));
}

TEST_F(ImportTest, FortranOrderIsTheSameArray) {
  // shape (2, 3): C order 0 1 2 / 3 4 5 is stored by columns as 0 3 1 4 2 5.
  std::string by_columns;
  for (const int i : {0, 3, 1, 4, 2, 5}) by_columns += raw_bytes(static_cast<double>(i), true);
  const CaptureFile file =
      import_captures({npy(npy_bytes(">f8", "(2, 3)", by_columns, true))}, with_axes("column,bin"));
  EXPECT_EQ(file.captures[0].counts.columns, 2);
  EXPECT_THAT(file.captures[0].counts.values, ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST_F(ImportTest, AxesInAnyOrder) {
  // [bin 2][row 2][column 3], slowest first.
  const std::string bytes = npy_bytes("<f8", "(2, 2, 3)", counting(12));
  const CaptureFile cube = import_captures({npy(bytes)}, with_axes("bin, row, column"));
  ASSERT_EQ(cube.captures.size(), 1u);
  EXPECT_EQ(cube.captures[0].counts.rows, 2);
  EXPECT_EQ(cube.captures[0].counts.columns, 3);
  EXPECT_EQ(cube.captures[0].counts.bins, 2);
  EXPECT_THAT(cube.captures[0].counts.values, ElementsAre(0, 6, 1, 7, 2, 8, 3, 9, 4, 10, 5, 11));

  const CaptureFile turned = import_captures({npy(bytes)}, with_axes("capture,column,bin"));
  ASSERT_EQ(turned.captures.size(), 2u);
  EXPECT_EQ(turned.captures[1].counts.rows, 1);
  EXPECT_EQ(turned.captures[1].index, 1);
  EXPECT_EQ(turned.captures[1].source, folder_.file("a.npy"));
  EXPECT_THAT(turned.captures[1].counts.values, ElementsAre(6, 7, 8, 9, 10, 11));
}

TEST_F(ImportTest, ZonesAreLaidOutAsStatedOrInASquare) {
  const std::string path = npy(npy_bytes("<f8", "(4, 2)", counting(8)));
  ImportOptions options = with_axes("zone,bin");
  std::vector<std::string> warnings;
  EXPECT_EQ(import_captures({path}, options, &warnings).captures[0].counts.rows, 2);
  EXPECT_THAT(warnings, ElementsAre(HasSubstr("2 rows of 2")));
  options.rows = 1;
  options.columns = 4;
  warnings.clear();
  EXPECT_EQ(import_captures({path}, options, &warnings).captures[0].counts.columns, 4);
  EXPECT_THAT(warnings, IsEmpty());
  options.rows = 3;
  EXPECT_THAT(import_error(path, options), AllOf(HasSubstr("4 zones"), HasSubstr("3 x 4")));
  const std::string six = npy(npy_bytes("<f8", "(6, 2)", counting(12)));
  EXPECT_THAT(import_error(six, with_axes("zone,bin")), HasSubstr("have to be stated"));
}

TEST_F(ImportTest, OptionsFillInWhatTheArrayDoesNotSay) {
  ImportOptions options = with_axes("bin");
  options.bin_width = 88e-12;
  options.exposures = 20;
  options.dispersion = 2.0;
  options.sensor = "mine";
  options.description = "text";
  const CaptureFile file = import_captures({npy(npy_bytes("|u1", "(1,)", "\x01"))}, options);
  EXPECT_EQ(file.bin_width, 88e-12);
  EXPECT_EQ(file.sensor, "mine");
  EXPECT_EQ(file.description, "text");
  EXPECT_EQ(file.captures[0].exposures, 20);
  EXPECT_EQ(file.captures[0].dispersion, 2.0);
}

TEST_F(ImportTest, SeveralFilesAreOneSequence) {
  write_text(folder_.file("b.npy"), npy_bytes("|u1", "(2, 2)", "\x01\x02\x03\x04"));
  write_text(folder_.file("a.npy"), npy_bytes("<f8", "(1, 2)", counting(2)));
  const CaptureFile file =
      import_captures({folder_.file("b.npy"), folder_.file("a.npy")}, with_axes("capture,bin"));
  ASSERT_EQ(file.captures.size(), 3u);
  EXPECT_EQ(file.captures[1].source, folder_.file("b.npy"));
  EXPECT_EQ(file.captures[1].index, 1);
  EXPECT_EQ(file.captures[2].source, folder_.file("a.npy"));
  EXPECT_EQ(file.captures[2].index, 0);
  write_text(folder_.file("c.npy"), npy_bytes("<f8", "(1, 3)", counting(3)));
  EXPECT_THAT(
      error_of([&] {
        import_captures({folder_.file("b.npy"), folder_.file("c.npy")}, with_axes("capture,bin"));
      }),
      AllOf(StartsWith(folder_.file("c.npy")), HasSubstr("1 x 1 x 3")));
}

TEST_F(ImportTest, UnsuitableArraysAreNamedWithTheReason) {
  EXPECT_THAT(npy_error(npy_bytes("|b1", "(1,)", "\x01")), HasSubstr("booleans"));
  EXPECT_THAT(npy_error(npy_bytes("<c8", "(1,)", "12345678")), HasSubstr("complex"));
  EXPECT_THAT(npy_error(npy_bytes("|O", "(1,)", "12345678")), HasSubstr("Python objects"));
  EXPECT_THAT(npy_error(npy_bytes("<f16", "(1,)", std::string(16, 'x'))), HasSubstr("<f16"));
  EXPECT_THAT(npy_error(npy_bytes("<U1", "(1,)", raw_bytes(65, 4))), HasSubstr("text"));
  EXPECT_THAT(npy_error(npy_bytes("<f8", "(2,)", counting(1))),
              AllOf(HasSubstr("truncated"), HasSubstr("8 bytes"), HasSubstr("16")));
  EXPECT_THAT(npy_error(npy_bytes("<f8", "(1,)", counting(2))), HasSubstr("too long"));
  EXPECT_THAT(npy_error(npy_bytes("<f8", "(4294967296, 4294967296)", "")), HasSubstr("truncated"));
  EXPECT_THAT(npy_error(npy_bytes("<f8", "(0,)", "")), HasSubstr("empty"));
  EXPECT_THAT(npy_error("nothing like it"), HasSubstr("not a .npy array"));
  EXPECT_THAT(npy_error(npy_bytes("<f8", "(1,)", counting(1)).substr(0, 30)),
              HasSubstr("truncated"));
  EXPECT_THAT(npy_error(npy_bytes("<f8", "(1,", counting(1))), HasSubstr("header"));
  EXPECT_THAT(npy_error(npy_bytes("<f8", "(2, 3)", counting(6))),
              AllOf(HasSubstr("(2, 3)"), HasSubstr("'bin' name 1")));
  EXPECT_THAT(npy_error(npy_bytes("<f8", "(2, 3)", counting(6)), ""),
              AllOf(HasSubstr("order of its axes"), HasSubstr("(2, 3)")));
  EXPECT_EQ(import_error(folder_.file("none.npy"), with_axes("bin")),
            folder_.file("none.npy") + ": no such file");
}

TEST_F(ImportTest, UnsuitableOptionsAreNamed) {
  const std::string path = npy(npy_bytes("<f8", "(2,)", counting(2)));
  const auto message = [&](auto change) {
    ImportOptions options = with_axes("bin");
    change(options);
    return import_error(path, options);
  };
  using O = ImportOptions;
  EXPECT_THAT(message([](O& o) { o.axes = "time"; }),
              AllOf(StartsWith("axes: "), HasSubstr("time")));
  EXPECT_THAT(message([](O& o) { o.axes = "row,column"; }), HasSubstr("bin is missing"));
  EXPECT_THAT(message([](O& o) { o.axes = "bin,bin"; }), HasSubstr("twice"));
  EXPECT_THAT(message([](O& o) { o.axes = "zone,row,bin"; }), HasSubstr("zone stands for"));
  EXPECT_THAT(message([](O& o) { o.rows = 3; }), StartsWith("columns: is missing"));
  EXPECT_THAT(message([](O& o) { o.rows = -3; }), StartsWith("rows: found -3"));
  EXPECT_THAT(message([](O& o) { o.rows = o.columns = 2; }), HasSubstr("2 x 2"));
  EXPECT_THAT(message([](O& o) { o.bin_width = -1; }), StartsWith("bin_width: found -1"));
  EXPECT_THAT(message([](O& o) { o.exposures = 0; }), StartsWith("exposures: found 0"));
  EXPECT_THAT(message([](O& o) { o.dispersion = std::nan(""); }), StartsWith("dispersion: "));
  EXPECT_THAT(message([](O& o) { o.axes_world = "x,y,y"; }), StartsWith("axes_world: "));
  EXPECT_THAT(message([](O& o) { o.axes_world = "x,y"; }), StartsWith("axes_world: "));
  EXPECT_THAT(message([](O& o) { o.sensor_positions = "p"; }), HasSubstr("sensor_positions"));
  EXPECT_THAT(error_of([] { import_captures({}); }), HasSubstr("no files"));
}

// ---- .npz ----

TEST_F(ImportTest, NpzArrayIsChosenByName) {
  const std::string path = folder_.file("a.npz");
  const std::string one = npy_bytes("|u1", "(2,)", "\x01\x02");
  const std::string other = npy_bytes("|u1", "(2,)", "\x03\x04");
  write_npz(path, {{"only", one}});
  EXPECT_THAT(import_captures({path}, with_axes("bin")).captures[0].counts.values,
              ElementsAre(1, 2));
  write_npz(path, {{"first", one}, {"second", other}});
  EXPECT_THAT(import_error(path, with_axes("bin")),
              AllOf(StartsWith(path), HasSubstr("first, second")));
  ImportOptions options = with_axes("bin");
  options.array = "second";
  EXPECT_THAT(import_captures({path}, options).captures[0].counts.values, ElementsAre(3, 4));
  options.array = "third";
  EXPECT_THAT(import_error(path, options),
              AllOf(StartsWith(path), HasSubstr("no array third"), HasSubstr("first, second")));
  write_npz(path, {{"counts", one}, {"extra", other}});
  EXPECT_THAT(import_captures({path}, with_axes("bin")).captures[0].counts.values,
              ElementsAre(1, 2));
}

TEST_F(ImportTest, DamagedArchivesAreNamed) {
  const std::string path = folder_.file("a.npz");
  export_npz(path, test::make_captures(3, 3, 3, 64));
  const std::string bytes = read_text(path);
  for (std::size_t length = 0; length < bytes.size(); length += 29) {
    write_text(path, bytes.substr(0, length));
    EXPECT_THAT(import_error(path), StartsWith(path + ": ")) << length;
  }
  for (std::size_t at = 0; at < bytes.size(); at += 13) {
    std::string copy = bytes;
    copy[at] = static_cast<char>(copy[at] ^ 0x55);
    write_text(path, copy);
    const std::string message = import_error(path);  // some bytes do not matter
    if (!message.empty()) {
      EXPECT_THAT(message, StartsWith(path + ": "));
    }
  }
}

TEST_F(ImportTest, MetadataHaveToFitTheCounts) {
  const std::string path = folder_.file("a.npz");
  const std::string document =
      R"({"format":"blindcorner.capture/1","rows":1,"columns":1,"bins":2,"captures":[{}]})";
  std::string text;
  for (const char c : document) text += raw_bytes(static_cast<unsigned char>(c), 4);
  const std::string metadata = npy_bytes("<U" + std::to_string(document.size()), "()", text);
  write_npz(path,
            {{"counts", npy_bytes("<f8", "(1, 1, 2)", counting(2))}, {"metadata_json", metadata}});
  EXPECT_THAT(import_captures({path}).captures[0].counts.values, ElementsAre(0, 1));
  write_npz(path,
            {{"counts", npy_bytes("<f8", "(1, 1, 3)", counting(3))}, {"metadata_json", metadata}});
  EXPECT_THAT(import_error(path),
              AllOf(StartsWith(path), HasSubstr("(1, 1, 3)"), HasSubstr("(1, 1, 2)")));
  // Stated axes turn our metadata off.
  EXPECT_EQ(import_captures({path}, with_axes("capture,zone,bin")).captures[0].counts.bins, 3);
}

TEST_F(ImportTest, SensorPositionsAreTurnedIntoTheWorld) {
  const std::string path = folder_.file("a.npz");
  write_npz(path, {{"h", npy_bytes("<f8", "(2, 1)", counting(2))},
                   {"p", npy_bytes("<f8", "(2, 3)", counting(6))}});
  ImportOptions options = with_axes("capture,bin");
  options.array = "h";
  options.sensor_positions = "p";
  options.axes_world = "z,-x,y";
  options.sensor_rotation = Eigen::AngleAxisd(kPi / 2, Eigen::Vector3d::UnitZ());
  const CaptureFile file = import_captures({path}, options);
  // The second row is (3, 4, 5).
  const Transform& pose = file.captures[1].T_world_sensor.value();
  EXPECT_EQ(pose.translation(), Eigen::Vector3d(5, -3, 4));
  EXPECT_TRUE((pose.linear() * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitY()));
  options.sensor_positions = "h";
  EXPECT_THAT(import_error(path, options), AllOf(HasSubstr("array h"), HasSubstr("(2, 3)")));
}

// ---- TMF8828 logs ----

/// Counts of channel `c` in measurement `m`, up to 24 bits.
int log_count(int m, int c, int bin) { return m * 1'000'000 + c * 70'000 + bin * 300 + 5; }

std::string raw_line(int index, const std::string& bytes, int address = 65) {
  return "#Raw," + std::to_string(address) + "," + std::to_string(index) + bytes + "\r\n";
}

/// Lines [first, end) of one measurement; channel 9 is empty unless `ninth`.
std::string measurement(int m, bool ninth, int first = 0, int end = 30, int address = 65) {
  std::string text;
  for (int index = first; index < end; ++index) {
    std::string bytes;
    for (int bin = 0; bin < 128; ++bin) {
      const int count = index % 10 == 9 && !ninth ? 0 : log_count(m, index % 10, bin);
      bytes += "," + std::to_string(count >> (8 * (index / 10)) & 0xff);
    }
    text += raw_line(index, bytes, address);
  }
  return text;
}

std::string result_line(int number) {
  return "#Obj,65," + std::to_string(number) + ",30,9,100,1,2\n";
}

class LogTest : public ImportTest {
 protected:
  CaptureFile import_log(const std::string& text, int side = 3) {
    write_text(path_, text);
    ImportOptions options;
    options.rows = options.columns = side;
    warnings_.clear();
    return import_captures({path_}, options, &warnings_);
  }
  std::string log_error(const std::string& text, int side = 3) {
    std::string message = error_of([&] { import_log(text, side); });
    EXPECT_THAT(message, StartsWith(path_ + ": "));
    return message;
  }

  std::string path_ = folder_.file("log.csv");
  std::vector<std::string> warnings_;
};

TEST_F(LogTest, NineChannelsAreOneCapture) {
  const CaptureFile file = import_log("sep=,\nhello\n#Cal,65,0,1,2\n" + measurement(0, true) +
                                      result_line(1) + "#RCo0,1,2,3\n" + measurement(5, true));
  EXPECT_THAT(warnings_, IsEmpty());
  EXPECT_EQ(file.sensor, "tmf8828");
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_EQ(file.captures[1].index, 1);
  for (int zone = 0; zone < 9; ++zone) {
    for (int bin = 0; bin < 128; ++bin) {
      ASSERT_EQ(file.captures[1].counts.zone(zone)[bin], log_count(5, zone + 1, bin));
    }
  }
}

TEST_F(LogTest, SixteenZonesAreTwoMeasurements) {
  const CaptureFile file = import_log(measurement(0, false) + measurement(1, false), 4);
  EXPECT_THAT(warnings_, IsEmpty());
  ASSERT_EQ(file.captures.size(), 1u);
  EXPECT_EQ(file.captures[0].counts.zone(0)[9], log_count(0, 1, 9));
  EXPECT_EQ(file.captures[0].counts.zone(7)[9], log_count(0, 8, 9));
  EXPECT_EQ(file.captures[0].counts.zone(8)[9], log_count(1, 1, 9));
}

std::string frame_8x8() {
  std::string text;
  for (int m = 0; m < 8; ++m) {
    text += measurement(m, false);
    if (m % 2 == 1) text += result_line(12 + m / 2);
  }
  return text;
}

TEST_F(LogTest, SixtyFourZonesAreInterleaved) {
  const CaptureFile file = import_log(frame_8x8(), 8);
  EXPECT_THAT(warnings_, IsEmpty());
  ASSERT_EQ(file.captures.size(), 1u);
  // (zone, measurement, channel) as two published drivers place them: 1-based pixel 57 is channel 1
  // of the first measurement, 61 channel 2, 8 channel 8 of the last.
  const int known[][3] = {{56, 0, 1}, {60, 0, 2}, {40, 0, 3}, {12, 0, 8}, {57, 1, 1}, {15, 3, 8},
                          {48, 4, 1}, {0, 4, 7},  {7, 7, 8},  {55, 7, 2}, {63, 3, 2}};
  for (const auto& [zone, m, channel] : known) {
    EXPECT_EQ(file.captures[0].counts.zone(zone)[3], log_count(m, channel, 3)) << zone;
  }
}

TEST_F(LogTest, ResultsTellWhereTheFrameBegins) {
  std::string late;  // the log begins with the third measurement of a frame
  for (int m = 2; m < 8; ++m) {
    late += measurement(m, false);
    if (m % 2 == 1) late += result_line(m / 2);
  }
  const CaptureFile file = import_log(late + frame_8x8(), 8);
  ASSERT_EQ(file.captures.size(), 1u);
  EXPECT_EQ(file.captures[0].counts.zone(56)[0], log_count(0, 1, 0));
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("left out")));
}

TEST_F(LogTest, CutOffCapturesAreLeftOutAndReported) {
  const std::string whole = measurement(0, true);
  CaptureFile file = import_log(whole + measurement(1, true, 0, 17));
  EXPECT_EQ(file.captures.size(), 1u);
  EXPECT_THAT(warnings_, ElementsAre(AllOf(HasSubstr(path_), HasSubstr("ends within"))));
  const std::string next = measurement(1, true);
  file = import_log(whole + next.substr(0, next.size() - 10));  // within the last line
  EXPECT_EQ(file.captures.size(), 1u);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("ends within")));
  file = import_log(measurement(1, true, 5) + whole);
  EXPECT_EQ(file.captures.size(), 1u);
  EXPECT_THAT(warnings_, ElementsAre(AllOf(HasSubstr("line 1"), HasSubstr("begins within"))));
  file = import_log(measurement(0, false) + measurement(1, false) + measurement(0, false), 4);
  EXPECT_EQ(file.captures.size(), 1u);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("ends within")));
}

TEST_F(LogTest, LostLinesCostOneCapture) {
  const std::string broken = measurement(1, true, 0, 12) + measurement(1, true, 13);
  const CaptureFile file = import_log(measurement(0, true) + broken + measurement(2, true));
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_EQ(file.captures[1].counts.zone(0)[0], log_count(2, 1, 0));
  EXPECT_THAT(warnings_, ElementsAre(AllOf(HasSubstr("line 43"), HasSubstr("expected index 12"))));
  // Where a capture has several measurements, nothing tells which one comes next.
  EXPECT_THAT(log_error(measurement(0, false) + broken, 4),
              AllOf(HasSubstr("line 43"), HasSubstr("unknown which zones")));
  // What was before is kept, and what comes when the board starts again.
  const std::string whole = measurement(0, false) + measurement(1, false);
  const CaptureFile around =
      import_log(whole + broken + whole + "TMF8828 Arduino=13\r\n" + whole, 4);
  ASSERT_EQ(around.captures.size(), 2u);
  EXPECT_EQ(around.captures[1].counts.zone(8)[0], log_count(1, 1, 0));
  EXPECT_THAT(warnings_, ElementsAre(AllOf(HasSubstr("line 73"), HasSubstr("unknown which"))));
}

TEST_F(LogTest, DamagedLinesAreNamed) {
  const std::string good = measurement(0, true);
  const auto with_line = [&](const std::string& line) { return good + line + "\n" + good; };
  std::string bytes;
  for (int bin = 0; bin < 127; ++bin) bytes += ",1";
  const auto warning = [&](const std::string& line) {
    EXPECT_EQ(import_log(with_line(line)).captures.size(), 2u);
    EXPECT_EQ(warnings_.size(), 1u);
    return warnings_.empty() ? std::string() : warnings_.front();
  };
  EXPECT_THAT(warning("#Raw,65,0" + bytes + ",1,1"), HasSubstr("132 fields"));
  EXPECT_THAT(warning("#Raw,65,0" + bytes + ",256"),
              AllOf(HasSubstr("line 31"), HasSubstr("byte 127"), HasSubstr("'256'")));
  EXPECT_THAT(warning("#Raw,65,0" + bytes + ",-1"), HasSubstr("'-1'"));
  EXPECT_THAT(warning("#Raw,65,0" + bytes + ",1x"), HasSubstr("'1x'"));
  EXPECT_THAT(warning("#Raw,65,0" + bytes + ","), HasSubstr("130 fields"));
  EXPECT_THAT(warning("#Raw,65,30" + bytes + ",1"), HasSubstr("index is '30'"));
  EXPECT_THAT(warning("#Raw,65,0,1,2#Raw,65,1" + bytes), HasSubstr("left out"));
  EXPECT_THAT(log_error("#Raw,65,0" + bytes + ",256\n#Raw,65,1\n"),
              AllOf(HasSubstr("no complete capture"), HasSubstr("byte 127 is '256'")));
  EXPECT_THAT(log_error(measurement(0, true, 0, 20)), HasSubstr("no complete capture"));
}

TEST_F(LogTest, ATruncatedLineIsLeftOutAndNamed) {
  const std::string good = measurement(0, true);
  EXPECT_EQ(import_log(good + "#Raw,65,0,1,1\n" + good).captures.size(), 2u);
  EXPECT_THAT(warnings_, ElementsAre(AllOf(HasSubstr("line 31"), HasSubstr("5 fields"))));
  // Within a measurement, that one is lost with it.
  std::string broken = good;
  broken.erase(broken.find("\r\n") - 40, 40);
  EXPECT_EQ(import_log(good + broken + good).captures.size(), 2u);
  ASSERT_GE(warnings_.size(), 1u);
  EXPECT_THAT(warnings_.front(), HasSubstr("line 31"));
}

TEST_F(LogTest, TimesOfASerialMonitorAreNoPartOfALine) {
  const std::string good = measurement(0, true);
  for (const std::string stamp :
       {"12:34:56.789 -> ", "[2026-01-31 12:34:56.789] ", "12:34:56.789 > ",
        "2026-01-31T12:34:56.789 ", "12:34:56.789\t", "1769862896789: "}) {
    std::string stamped;
    for (std::size_t at = 0; at < good.size(); at = good.find('\n', at) + 1) {
      stamped += stamp + good.substr(at, good.find('\n', at) + 1 - at);
    }
    const CaptureFile file = import_log(stamped);
    ASSERT_EQ(file.captures.size(), 1u) << stamp;
    EXPECT_EQ(file.captures[0].counts.zone(0)[0], log_count(0, 1, 0));
    EXPECT_TRUE(warnings_.empty());
  }
}

TEST_F(LogTest, WrongLayoutIsSuspectedFromTheNinthChannel) {
  import_log(measurement(0, false) + measurement(1, false), 3);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("suggests 4 x 4 or 8 x 8")));
  import_log(measurement(0, true) + measurement(1, true), 4);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("suggests 3 x 3")));
  EXPECT_THAT(error_of([&] { import_log(measurement(0, true), 5); }),
              HasSubstr("5 x 5, a TMF8828 log is"));
}

TEST_F(LogTest, ARestartOfTheBoardCostsTheCaptureThatItCut) {
  const std::string whole = measurement(0, false) + measurement(1, false);
  const CaptureFile file =
      import_log(whole + measurement(5, false) + "TMF8828 Arduino=13\r\n" + whole, 4);
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_EQ(file.captures[1].counts.zone(0)[0], log_count(0, 1, 0));
  EXPECT_THAT(warnings_, ElementsAre(AllOf(HasSubstr("line 91"), HasSubstr("started again"))));
}

TEST_F(LogTest, OfSeveralSensorsTheFirstIsKeptUnlessOneIsChosen) {
  const std::string text =
      measurement(0, true) + measurement(3, true, 0, 30, 66) + measurement(1, true);
  const CaptureFile first = import_log(text);
  ASSERT_EQ(first.captures.size(), 2u);
  EXPECT_EQ(first.captures[1].counts.zone(0)[0], log_count(1, 1, 0));
  EXPECT_THAT(warnings_, ElementsAre(AllOf(HasSubstr("line 31"), HasSubstr("address 66"),
                                           HasSubstr("--i2c-address chooses"))));
  ImportOptions options;
  options.i2c_address = 66;
  const CaptureFile file = import_captures({path_}, options);
  ASSERT_EQ(file.captures.size(), 1u);
  EXPECT_EQ(file.captures[0].counts.zone(0)[0], log_count(3, 1, 0));
}

TEST_F(LogTest, OptionsWithoutEffectAreRefused) {
  write_text(path_, measurement(0, true));
  EXPECT_THAT(import_error(path_, with_axes("bin")), StartsWith("axes: "));
}

TEST_F(ImportTest, UnknownFormatsAreNamed) {
  write_text(folder_.file("a.txt"), "hello");
  const std::string message = import_error(folder_.file("a.txt"));
  EXPECT_THAT(message, AllOf(StartsWith(folder_.file("a.txt")), HasSubstr("not recognised")));
  for (const ImportReader& reader : import_readers()) {
    EXPECT_THAT(message, HasSubstr(reader.name + ": " + reader.recognises));
  }
  ImportOptions options;
  options.format = "tmf9999";
  EXPECT_THAT(import_error(folder_.file("a.txt"), options),
              AllOf(StartsWith("format: found 'tmf9999'"), HasSubstr("tmf8829")));
  EXPECT_THAT(import_error(folder_.file("a.exr")), HasSubstr("capture file already"));
  EXPECT_THAT(import_error(folder_.file("none.log")), HasSubstr("no such file"));
}

// ---- ST person tracking ----

TEST_F(ImportTest, PersonTrackingFolderIsReadInOrder) {
  const auto volume = [](int first) {
    std::string hists, points;
    for (int i = 0; i < 8; ++i) hists += raw_bytes(static_cast<double>(first + i));
    for (int i = 0; i < 12; ++i) points += raw_bytes(i < 9 ? i + 1.0 : 0.0);
    return std::vector<std::pair<std::string, std::string>>{
        {"hists", npy_bytes("<f8", "(4, 2)", hists)},
        {"pt_cloud", npy_bytes("<f8", "(4, 3)", points)}};
  };
  EXPECT_THAT(import_error(folder_.path()), HasSubstr("not recognised"));
  write_text(folder_.file("metadata.yaml"), "rosbag2_bagfile_information:\n");
  EXPECT_THAT(import_error(folder_.path()), HasSubstr("is a ROS bag, accepted: in Python"));
  std::filesystem::remove(folder_.file("metadata.yaml"));
  write_text(folder_.file("a.mcap"), "\x89MCAP0\r\n");
  EXPECT_THAT(import_error(folder_.file("a.mcap")), HasSubstr("is a ROS bag"));
  write_npz(folder_.file("volume_000010.npz"), volume(100));
  write_npz(folder_.file("volume_000002.npz"), volume(0));
  write_text(folder_.file("notes.txt"), "not a volume");
  const CaptureFile file = import_captures({folder_.path()});
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_EQ(file.sensor, "vl53l8ch");
  EXPECT_EQ(file.bin_width, 250e-12);
  EXPECT_EQ(file.captures[0].source, folder_.file("volume_000002.npz"));
  EXPECT_EQ(file.captures[1].counts.values[0], 100);
  EXPECT_EQ(file.captures[1].counts.rows, 2);
  const auto& points = file.captures[0].relay_points.value();
  EXPECT_EQ(points[1], Eigen::Vector3d(4, -6, 5));  // (x, -z, y) of (4, 5, 6)
  EXPECT_EQ(points[3], Eigen::Vector3d(0, 0, 0));   // a dead zone stays where it is

  auto wrong = volume(0);
  wrong[1].second = npy_bytes("<f8", "(3, 3)", counting(9));
  write_npz(folder_.file("volume_000011.npz"), wrong);
  EXPECT_THAT(import_error(folder_.path()), AllOf(StartsWith(folder_.file("volume_000011.npz")),
                                                  HasSubstr("pt_cloud"), HasSubstr("(3, 3)")));
}

// ---- Measured data ----

TEST(ImportDataTest, PersonTracking) {
  const std::string folder = test::data_folder() + "/consumer_nlos/st_person_tracking";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "no data at " << folder;
  const CaptureFile file = import_captures({folder});
  ASSERT_EQ(file.captures.size(), 300u);
  double total = 0.0;
  for (const Capture& capture : file.captures) {
    ASSERT_EQ(capture.counts.zones(), 16);
    ASSERT_EQ(capture.counts.bins, 128);
    for (const Eigen::Vector3d& point : capture.relay_points.value()) {
      EXPECT_LT(std::abs(point.y()), 0.05);  // the wall is y = 0, flat to a few centimetres
    }
    for (int zone = 0; zone < 16; ++zone) {
      for (int bin = 0; bin < 15; ++bin) ASSERT_EQ(capture.counts.zone(zone)[bin], 0.0);  // gated
      for (int bin = 15; bin < 128; ++bin) total += capture.counts.zone(zone)[bin];
    }
  }
  EXPECT_GT(total, 0.0);
}

TEST(ImportDataTest, LetterU) {
  const std::string path = test::data_folder() + "/consumer_nlos/ams_u/ams_u.npz";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no data at " << path;
  ImportOptions options;
  options.axes = "capture,row,column,bin";
  options.array = "histogram";
  options.sensor_positions = "sensor_position_m";
  options.axes_world = "z,-x,y";
  options.bin_width = 88e-12;
  options.exposures = 20;
  const CaptureFile file = import_captures({path}, options);
  ASSERT_EQ(file.captures.size(), 36u);
  EXPECT_EQ(file.captures[0].counts.rows, 3);
  EXPECT_EQ(file.captures[0].counts.bins, 128);
  // Second position: x = 0.256 to the right, y = 0.96 up; world y points left.
  const Eigen::Vector3d second = file.captures[1].T_world_sensor.value().translation();
  EXPECT_TRUE(second.isApprox(Eigen::Vector3d(0.0, -0.256, 0.96), 1e-3));
  // The first bounce of about 3e5 counts stands out of an ambient of 460.
  const HistogramCube& cube = file.captures[0].counts;
  const double* centre = cube.zone(4);
  EXPECT_GT(*std::max_element(centre, centre + cube.bins), 1e5);
}

}  // namespace
}  // namespace blindcorner
