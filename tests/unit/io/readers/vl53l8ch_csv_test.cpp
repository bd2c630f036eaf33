// SPDX-License-Identifier: Apache-2.0
/// Tables of ST's VL53L8CH kit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "blindcorner/io/import_file.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

using test::error_of;
using test::TemporaryFolder;
using test::write_text;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr int kZones = 4;
constexpr int kBins = 3;

/// As the kit writes it: other columns about, bins of one index together.
std::string heading(char separator = ',') {
  std::string text = "frame_id";
  for (int bin = 0; bin < kBins; ++bin) {
    for (int zone = 0; zone < kZones; ++zone) {
      text += separator;
      text += "cnh__hist_bin_" + std::to_string(bin) + "_a" + std::to_string(zone);
    }
  }
  return text + separator + "target_status\r\n";
}

std::string row(int frame, char separator = ',', char point = '.') {
  std::string text = std::to_string(frame);
  for (int bin = 0; bin < kBins; ++bin) {
    for (int zone = 0; zone < kZones; ++zone) {
      text += separator;
      text += "-" + std::to_string(100 * frame + 10 * zone + bin) + point + "5";
    }
  }
  return text + separator + "ok\r\n";
}

class KitTable : public ::testing::Test {
 protected:
  CaptureFile import(const std::string& text) {
    write_text(path_, text);
    notes_.clear();
    return import_captures({path_}, {}, &notes_);
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("data_VL53L8CH.csv");
  std::vector<std::string> notes_;
};

TEST_F(KitTable, ARowIsACapture) {
  const CaptureFile file = import("\xef\xbb\xbf" + heading() + row(0) + row(1));
  EXPECT_EQ(file.sensor, "vl53l8ch");
  EXPECT_EQ(file.bin_width, 0);  // not in the table: it depends on the kit's settings
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_EQ(file.captures[1].counts.rows, 2);
  EXPECT_EQ(file.captures[1].counts.bins, kBins);
  EXPECT_EQ(file.captures[1].counts.zone(3)[2], -132.5);
}

TEST_F(KitTable, DecimalCommas) {
  const CaptureFile file = import(heading(';') + row(1, ';', ','));
  EXPECT_EQ(file.captures.at(0).counts.zone(2)[1], -121.5);
}

TEST_F(KitTable, CutAndDamagedRowsAreNamed) {
  std::string damaged = row(1);
  damaged.replace(damaged.find("-110.5"), 6, "-11o.5");
  EXPECT_EQ(import(heading() + row(0) + damaged + row(2) + row(3).substr(0, 40)).captures.size(),
            2u);
  EXPECT_THAT(notes_, Contains(AllOf(HasSubstr(path_ + ": line 3: "), HasSubstr("'-11o.5'"))));
  EXPECT_THAT(notes_, Contains(AllOf(HasSubstr("line 5: "), HasSubstr("of 14 columns"))));
}

TEST_F(KitTable, AnotherRecordingInTheSameFile) {
  EXPECT_EQ(import(heading() + row(0) + heading() + row(1)).captures.size(), 2u);
}

TEST_F(KitTable, ColumnsHaveToBeWhole) {
  std::string text = heading();
  text.replace(text.find("bin_1_a2"), 8, "bin_7_a2");
  EXPECT_THAT(error_of([&] { import(text + row(0)); }),
              AllOf(HasSubstr("line 1: "), HasSubstr("is missing")));
  EXPECT_THAT(error_of([&] { import(heading()); }), HasSubstr("no whole row"));
}

TEST_F(KitTable, TheKitsFolder) {
  write_text(folder_.file("info_VL53L8CH.csv"), "sensor,VL53L8CH\r\n");
  write_text(path_, heading() + row(0));
  const CaptureFile file = import_captures({folder_.path()});
  ASSERT_EQ(file.captures.size(), 1u);
  EXPECT_EQ(file.captures[0].source, path_);
}

}  // namespace
}  // namespace blindcorner
