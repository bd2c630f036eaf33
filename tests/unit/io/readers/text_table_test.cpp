// SPDX-License-Identifier: Apache-2.0
/// Any text table whose columns are stated.
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
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class AnyTable : public ::testing::Test {
 protected:
  CaptureFile import(const std::string& text, const std::string& pattern, int side = 0) {
    write_text(path_, text);
    notes_.clear();
    ImportOptions options;
    options.pattern = pattern;
    options.rows = options.columns = side;
    return import_captures({path_}, options, &notes_);
  }
  std::string table_error(const std::string& text, const std::string& pattern) {
    return error_of([&] { import(text, pattern); });
  }

  TemporaryFolder folder_;
  std::string path_ = folder_.file("table.txt");
  std::vector<std::string> notes_;
};

TEST_F(AnyTable, ALineForEachZone) {
  const CaptureFile file = import(
      "time zone bins\n0.1 0 1 2 3\n0.1 1 4 5 6\n0.1 2 7 8 9\n0.1 3 1 1 1\n"
      "0.2 0 9 9 9\n0.2 1 9 9 9\n0.2 2 9 9 9\n0.2 3 9 9 8\n",
      "skip,zone,counts");
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_EQ(file.captures[0].counts.rows, 2);
  EXPECT_THAT(file.captures[0].counts.values, ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9, 1, 1, 1));
  EXPECT_EQ(file.captures[1].counts.zone(3)[2], 8);
  EXPECT_THAT(notes_, Contains(HasSubstr("1 lines without numbers")));
}

TEST_F(AnyTable, ALineForEachBin) {
  // What `export` writes to .csv.
  const CaptureFile file = import(
      "capture,zone,row,column,bin,count\n0,0,0,0,0,1.5\n0,0,0,0,1,2\n1,0,0,0,0,3\n1,0,0,0,1,4\n",
      "capture,skip,row,column,bin,count");
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_THAT(file.captures[0].counts.values, ElementsAre(1.5, 2));
  EXPECT_THAT(file.captures[1].counts.values, ElementsAre(3, 4));
}

TEST_F(AnyTable, WordsChooseLinesAndCommasMayBeDecimal) {
  const CaptureFile file =
      import("boot\r\nH;0,5;1,5\r\nT;20,1;3\r\nH;2,5;3,5\r\nH;4;5\r\nH;6;7\r\n", "'H',counts", 2);
  ASSERT_EQ(file.captures.size(), 1u);
  EXPECT_THAT(file.captures[0].counts.values, ElementsAre(0.5, 1.5, 2.5, 3.5, 4, 5, 6, 7));
}

TEST_F(AnyTable, NumbersMayCountFromOneAndZonesMayFollowOneAnother) {
  const CaptureFile file = import(
      "1\t1\t5\n1\t2\t6\n1\t3\t7\n1\t4\t8\n2\t1\t1\n2\t2\t2\n2\t3\t3\n2\t4\t4\n", "bin,zone,count");
  ASSERT_EQ(file.captures.size(), 1u);
  EXPECT_THAT(file.captures[0].counts.values, ElementsAre(5, 1, 6, 2, 7, 3, 8, 4));
  EXPECT_THAT(notes_, Contains(HasSubstr("column bin counts from 1")));
}

TEST_F(AnyTable, CutLinesCostTheirCaptureAndAreNamed) {
  const auto frame = [](int n) {
    std::string text;
    for (int zone = 0; zone < 4; ++zone) {
      text +=
          std::to_string(zone) + " " + std::to_string(n) + " " + std::to_string(n + zone) + "\n";
    }
    return text;
  };
  std::string cut = frame(20);
  cut.erase(0, cut.find('\n') + 1);  // without its first line
  std::string torn = frame(30);
  torn.replace(torn.find("2 30 32"), 7, "2 3");  // a line of one bin
  const CaptureFile file = import(frame(10) + cut + torn + frame(40), "zone,counts");
  ASSERT_EQ(file.captures.size(), 2u);
  EXPECT_THAT(file.captures[1].counts.values, ElementsAre(40, 40, 40, 41, 40, 42, 40, 43));
  EXPECT_THAT(notes_, Contains(AllOf(HasSubstr("line 5: "), HasSubstr("lacks 2 of 8 bins"))));
  EXPECT_THAT(notes_, Contains(AllOf(HasSubstr("line 10: has 1 bins, most lines have 2"))));
}

TEST_F(AnyTable, PatternsThatSayNothingAreRefused) {
  EXPECT_THAT(table_error("1 2\n", "zones,counts"), HasSubstr("'zones' is no column"));
  EXPECT_THAT(table_error("1 2\n", "zone"), HasSubstr("either count or counts"));
  EXPECT_THAT(table_error("1 2\n", "counts,zone"), HasSubstr("not the last"));
  EXPECT_THAT(table_error("1 2\n", "zone,zone,counts"), HasSubstr("twice"));
  EXPECT_THAT(table_error("1 2\n", "row,counts"), HasSubstr("row and column go together"));
  EXPECT_THAT(table_error("a b\n", "zone,counts"), HasSubstr("no line has the columns"));
  EXPECT_THAT(table_error("900000000 1\n", "zone,counts"), HasSubstr("900000001 zones"));
}

}  // namespace
}  // namespace blindcorner
