// SPDX-License-Identifier: Apache-2.0
/// Serial log of VL53L8CH firmware.
#include "io/readers/vl53l8ch_log.h"

#include <gtest/gtest.h>

#include <sstream>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// A frame of 2 x 2 zones and three bins: bin b of zone z holds 10 z + b.
std::string frame(int zones = 4) {
  std::string text = "D\r\n";
  for (int z = 0; z < zones; ++z) {
    text += std::to_string(z) + " 1500 820";
    for (int b = 0; b < 3; ++b) text += " " + std::to_string(1000 * (10 * z + b));
    text += "\r\n";
  }
  return text;
}

TEST(Vl53l8chLog, FramesBecomeCaptures) {
  const std::string log = "Sensor started\r\n" + frame() + frame() + "D\r\n0 1500 820 1";
  EXPECT_TRUE(is_vl53l8ch_log(log));
  std::vector<std::string> warnings;
  const std::vector<Capture> captures = parse_vl53l8ch_log(log, "log.txt", {}, warnings);
  ASSERT_EQ(captures.size(), 2u);
  EXPECT_EQ(captures[1].counts.rows, 2);
  EXPECT_EQ(captures[1].counts.bins, 3);
  EXPECT_DOUBLE_EQ(captures[1].counts.zone(3)[2], 32);
  ASSERT_EQ(warnings.size(), 1u);  // the log ends within a frame
  EXPECT_NE(warnings[0].find("log.txt"), std::string::npos);
}

TEST(Vl53l8chLog, DamagedFramesAreLeftOutAndNamed) {
  std::string damaged = frame();
  damaged.replace(damaged.find("1 1500"), 6, "1 15x0");
  std::vector<std::string> warnings;
  EXPECT_EQ(parse_vl53l8ch_log(frame() + damaged + frame(3) + frame(), "log", {}, warnings).size(),
            2u);
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_NE(warnings[0].find("line 8"), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[1].find("3 of 4"), std::string::npos) << warnings[1];
}

TEST(Vl53l8chLog, TimesOfASerialMonitorAreNoPartOfALine) {
  for (const std::string stamp :
       {"12:34:56.789 -> ", "2026-01-31T12:34:56.789 ", "2026-01-31 12:34:56 ", "12:34:56.789\t"}) {
    std::string stamped;
    std::istringstream lines(frame());
    for (std::string line; std::getline(lines, line);) stamped += stamp + line + "\n";
    EXPECT_TRUE(is_vl53l8ch_log(stamped)) << stamp;
    std::vector<std::string> warnings;
    const std::vector<Capture> captures = parse_vl53l8ch_log(stamped, "log", {}, warnings);
    ASSERT_EQ(captures.size(), 1u) << stamp;
    EXPECT_DOUBLE_EQ(captures[0].counts.zone(3)[2], 32);
  }
}

// One long row and many short ones: as many bins for all zones would take gigabytes.
TEST(Vl53l8chLog, UnevenFramesAreLeftOutBeforeThereIsRoomForThem) {
  std::string uneven = "D\n0 1 1";
  for (int b = 0; b < 20'000; ++b) uneven += " 1";
  for (int z = 1; z < 22'500; ++z) uneven += "\n" + std::to_string(z) + " 1 1 1";
  std::vector<std::string> warnings;
  EXPECT_THROW(parse_vl53l8ch_log(uneven + "\n", "log", {}, warnings), Error);
  EXPECT_EQ(parse_vl53l8ch_log(frame() + uneven + "\n", "log", {}, warnings).size(), 1u);
}

TEST(Vl53l8chLog, OtherTextsAreRefused) {
  std::vector<std::string> warnings;
  EXPECT_FALSE(is_vl53l8ch_log("Dear reader\n1 2 3\n"));
  EXPECT_THROW(parse_vl53l8ch_log("nothing", "log", {}, warnings), Error);
  EXPECT_THROW(parse_vl53l8ch_log(frame(3), "log", {}, warnings), Error);  // no square
}

}  // namespace
}  // namespace blindcorner
