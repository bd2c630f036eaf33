// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/movingai.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

using ::testing::HasSubstr;

class MovingAi : public ::testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }
  std::string write(const std::string& text) const {
    std::ofstream(path_, std::ios::binary) << text;
    return path_;
  }
  std::string map_error(const std::string& text) const {
    try {
      read_movingai_map(write(text));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::string scenario_error(const std::string& text) const {
    try {
      read_movingai_scenario(write(text), kSize);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  inline static const GridGeometry kSize{.columns = 4, .rows = 3, .cell_size = 1};
  std::string path_ = ::testing::TempDir() + "movingai_test_" +
                      ::testing::UnitTest::GetInstance()->current_test_info()->name();
};

const std::string kHeader = "type octile\nheight 3\nwidth 4\nmap\n";

TEST_F(MovingAi, TheFirstRowIsTheHighest) {
  for (const std::string end : {"\n", "\r\n"}) {
    std::string text = kHeader + ".GS@\nOTW.\n@@@.\n";
    for (std::size_t at = 0; end == "\r\n" && (at = text.find('\n', at)) != std::string::npos;) {
      text.replace(at, 1, end);
      at += 2;
    }
    const MovingAiMap map = read_movingai_map(write(text));
    EXPECT_EQ(map.geometry.columns, 4);
    EXPECT_EQ(map.geometry.rows, 3);
    EXPECT_EQ(map.geometry.cell_size, 1);
    EXPECT_EQ(map.occupancy(), (std::vector<double>{1, 1, 1, 0, 1, 1, 1, 0, 0, 0, 0, 1}));
    EXPECT_EQ(map.occupancy(Terrain::water)[6], 0);
    EXPECT_EQ(map.occupancy(Terrain::water)[3], 1);
  }
}

TEST_F(MovingAi, MapErrorsNameLineAndWhatIsAccepted) {
  EXPECT_THAT(map_error("type tile\n"), HasSubstr("line 1: found \"type tile\", accepted: \"type"));
  EXPECT_THAT(map_error("type octile\nheight 0\n"), HasSubstr("line 2: found \"height 0\""));
  EXPECT_THAT(map_error("type octile\nheight 3\nwidth 4x\n"),
              HasSubstr("line 3: found \"width 4x"));
  EXPECT_THAT(map_error(kHeader + "....\n...\n"),
              HasSubstr("line 6: found 3 cells, accepted: a row of 4 cells"));
  EXPECT_THAT(map_error(kHeader + "....\n..x.\n"),
              HasSubstr("line 6: found \"x\" in column 3, accepted: '.', 'G'"));
  EXPECT_THAT(map_error(kHeader + "....\n....\n"), HasSubstr("line 7: found the end of the file"));
  EXPECT_THAT(map_error(kHeader + "....\n....\n....\n....\n"),
              HasSubstr("line 8: found \"....\", accepted: nothing after 3 rows"));
  EXPECT_THROW(read_movingai_map("/nowhere.map"), Error);
}

TEST_F(MovingAi, ProblemsAreTurnedAsTheMapIs) {
  const auto problems = read_movingai_scenario(
      write("version 1\n0\tm.map\t4\t3\t0\t0\t3\t2\t4.41421356\n12\tm.map\t4\t3\t1\t1\t1\t1\t0\n"),
      kSize);
  ASSERT_EQ(problems.size(), 2U);
  EXPECT_EQ(problems[0].start, (Cell{0, 2}));
  EXPECT_EQ(problems[0].goal, (Cell{3, 0}));
  EXPECT_EQ(problems[0].length, 4.41421356);
  EXPECT_NEAR(problems[0].rounding, 0.5e-8, 1e-15);
  EXPECT_EQ(problems[1].bucket, 12);
}

TEST_F(MovingAi, SixDigitsAreARounding) {
  const auto rounding = [&](const std::string& length) {
    return read_movingai_scenario(write("version 1.0\r\n0 m.map 4 3 0 0 3 2 " + length + "\r\n"),
                                  kSize)
        .front()
        .rounding;
  };
  EXPECT_NEAR(rounding("1204.36"), 0.005, 1e-12);
  EXPECT_NEAR(rounding("1204.4"), 0.005, 1e-12);  // a zero was left out
  EXPECT_NEAR(rounding("1204.36123"), 0.5e-5, 1e-12);
  EXPECT_NEAR(rounding("1"), 0.5e-5, 1e-12);
}

TEST_F(MovingAi, ScenarioErrorsNameLineAndWhatIsAccepted) {
  EXPECT_THAT(scenario_error("version 2\n"), HasSubstr("line 1: found \"version 2\""));
  EXPECT_THAT(scenario_error("version 1\n"), HasSubstr("found no problems"));
  EXPECT_THAT(scenario_error("version 1\n0 m 4 3 0 0 3 2\n"), HasSubstr("line 2: found 8 words"));
  EXPECT_THAT(scenario_error("version 1\n0 m 5 3 0 0 3 2 1\n"),
              HasSubstr("line 2: found a map of \"5 x 3\", accepted: the map's size, 4 x 3"));
  EXPECT_THAT(scenario_error("version 1\n0 m 4 3 0 3 3 2 1\n"),
              HasSubstr("found start \"0, 3\", accepted: column 0 to 3, row 0 to 2"));
  EXPECT_THAT(scenario_error("version 1\n0 m 4 3 0 0 3 2 nan\n"),
              HasSubstr("found length \"nan\""));
}

}  // namespace
}  // namespace blindcorner
