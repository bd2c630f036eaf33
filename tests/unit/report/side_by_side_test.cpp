// SPDX-License-Identifier: Apache-2.0
/// Which seeds tell most, and what a page holds of two drives.
#include "blindcorner/report/side_by_side.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "blindcorner/forward/error.h"
#include "blindcorner/report/drive_report.h"
#include "bundled.h"

namespace blindcorner {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

TrialResult result_of(const std::string& perception, std::uint64_t seed, const std::string& outcome,
                      double time = 5) {
  TrialResult result;
  result.trial.perception = perception;
  result.trial.seed = seed;
  result.outcome = outcome;
  result.time = time;
  return result;
}

/// The first seed that is won comes first; then each other kind once, also what speaks against the
/// second perception.
TEST(TellingSeeds, BeginWithWhatIsWonAndHoldWhatIsLost) {
  const std::vector<TrialResult> results{
      result_of("los", 1, "reached"),   result_of("solver", 1, "reached", 5.5),
      result_of("los", 2, "reached"),   result_of("solver", 2, "collision"),
      result_of("los", 3, "collision"), result_of("solver", 3, "reached"),
      result_of("los", 4, "collision"), result_of("solver", 4, "reached"),
      result_of("los", 5, "collision"), result_of("solver", 5, "collision"),
      result_of("los", 6, "reached"),   result_of("solver", 6, "reached", 9),
      result_of("los", 7, "stopped"),   result_of("solver", 7, "reached"),
      result_of("los", 8, "collision")};
  EXPECT_THAT(telling_seeds(results, {"los", "solver"}, 20), ElementsAre(3, 7, 2, 5, 6, 4, 1));
  EXPECT_THAT(telling_seeds(results, {"los", "solver"}, 1), ElementsAre(3));
  EXPECT_THAT(telling_seeds(results, {"los", "oracle"}, 5), ElementsAre());
}

TEST(TellingPerceptions, AreSightAndWhatSeesAroundTheCorner) {
  using Names = std::pair<std::string, std::string>;
  const auto of = [](std::initializer_list<const char*> names) {
    std::vector<TrialResult> results;
    for (const char* name : names) results.push_back(result_of(name, 1, "reached"));
    return telling_perceptions(results);
  };
  EXPECT_EQ(of({"los", "solver", "oracle"}), Names("los", "solver"));
  EXPECT_EQ(of({"los", "oracle"}), Names("los", "oracle"));
  EXPECT_EQ(of({"solver", "oracle"}), Names("solver", "oracle"));
  EXPECT_FALSE(of({"los"}).has_value());
}

/// A frame each half second on a straight line, ending at x = end.
nlohmann::json driven(const Drive& drive, const std::string& perception, DriveOutcome outcome,
                      double end) {
  DriveResult result;
  result.outcome = outcome;
  result.time = 2;
  result.end_speed = 10;
  result.trace_step = 1;
  result.clearance = 1;
  if (outcome == DriveOutcome::collision) result.hit = "cyclist";
  for (int i = 0; i < 2; ++i) {
    DriveFrame frame;
    frame.time = i;
    frame.vehicle.position = {end * i, -1.5};
    for (int k = 0; k < 400; ++k) frame.path.emplace_back(0.1 * k, -1.5);
    result.frames.push_back(frame);
    result.trace.emplace_back(end * i, -1.5, 0);
  }
  DriveOptions options;
  options.perception = perception;
  options.seed = 7;
  return drive_replay(drive, options, result);
}

TEST(ReplayPair, SaysHowBothEndAndShowsWhatBothNeed) {
  const Drive drive = bundled_drive("crossing_cyclist");
  const nlohmann::json pair =
      replay_pair(driven(drive, "los", DriveOutcome::collision, 5),
                  driven(drive, "solver", DriveOutcome::reached, 20), {"los/drive.html", ""});
  EXPECT_EQ(pair["headline"],
            "With direct sight only the car hits the cyclist at 36 km/h; with the solver, in the "
            "same world, it reaches its goal.");
  EXPECT_EQ(pair["why"], "los collision, solver reached");
  EXPECT_EQ(pair["seed"], 7);
  // Both drives, with a vehicle's length of room; the map ends at y = 8.
  EXPECT_NEAR(pair["lower_m"][0], -4.5, 1e-9);
  EXPECT_NEAR(pair["upper_m"][0], 24.5, 1e-9);
  EXPECT_EQ(pair["drives"][0]["page"], "los/drive.html");
  EXPECT_FALSE(pair["drives"][1].contains("page"));
  EXPECT_LE(pair["drives"][1]["drive"]["frames"][0]["plan"]["path_m"].size(), 41U);
  EXPECT_EQ(pair["drives"][1]["drive"]["end_speed_m_per_s"], 10);
  const std::string part = side_by_side_part({pair});
  EXPECT_THAT(part, HasSubstr("id=\"pairs\""));
  EXPECT_THAT(part, Not(HasSubstr("src=\"http")));
}

TEST(ReplayPair, RefusesTwoSeeds) {
  const Drive drive = bundled_drive("crossing_cyclist");
  nlohmann::json other = driven(drive, "solver", DriveOutcome::reached, 20);
  other["drive"]["seed"] = 8;
  EXPECT_THROW(replay_pair(driven(drive, "los", DriveOutcome::collision, 5), other), Error);
}

}  // namespace
}  // namespace blindcorner
