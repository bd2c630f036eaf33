// SPDX-License-Identifier: Apache-2.0
// The drives that come with the program, by one who is told the truth: every goal is reached, on
// plans that the vehicle can drive.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "blindcorner/simulation/drive_loop.h"

namespace blindcorner {
namespace {

class ShippedDrive : public ::testing::TestWithParam<std::string> {};

TEST_P(ShippedDrive, IsReachedByOneWhoIsToldTheTruth) {
  const Drive drive = read_drive(GetParam());
  if (drive.controller == DriveController::published) {
    GTEST_SKIP() << "the published controller holds its speed whatever is in its way";
  }
  const SimulatedSensor sensor(drive.scene);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    DriveOptions options;
    options.perception = "oracle";
    options.seed = seed;
    options.keep_pictures = false;
    const DriveResult result = drive_through(drive, sensor, options);
    EXPECT_EQ(result.outcome, DriveOutcome::reached) << "seed " << seed;
    for (const DriveFrame& frame : result.frames) {
      ASSERT_EQ(frame.plan_text.find("no_path"), std::string::npos)
          << frame.plan_text << ", seed " << seed << ", " << frame.time << " s";
    }
  }
}

std::vector<std::string> shipped_drives() {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(SOURCE_DIR "/scenes")) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with("_drive.json")) files.push_back(entry.path().string());
  }
  std::ranges::sort(files);
  return files;
}

INSTANTIATE_TEST_SUITE_P(All, ShippedDrive, ::testing::ValuesIn(shipped_drives()),
                         [](const auto& drive) {
                           return std::filesystem::path(drive.param).stem().string();
                         });

}  // namespace
}  // namespace blindcorner
