// SPDX-License-Identifier: Apache-2.0
/// The sentences at the top of a drive's page say how it ended, why, and what was known when.
#include "blindcorner/report/drive_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "blindcorner/simulation/true_world.h"
#include "bundled.h"

namespace blindcorner {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

const Drive& crossing() { return bundled_drive("crossing_cyclist"); }

/// A frame each second: nothing known, half sure, sure, then in direct sight.
DriveResult driven(DriveOutcome outcome) {
  DriveResult result;
  result.outcome = outcome;
  result.time = 4;
  result.length = 30;
  result.mean_speed = 7.5;
  result.end_speed = 5;
  result.clearance = 0.5;
  for (int i = 0; i < 4; ++i) {
    DriveFrame frame;
    frame.time = i;
    frame.truth = PoseVector::Zero(static_cast<Eigen::Index>(crossing().scene.unknowns.size()));
    if (i > 0) frame.mixture.emplace().presence_probability = i == 1 ? 0.5 : 1.0;
    if (i == 3) frame.fate = FrameFate::in_sight;
    result.frames.push_back(frame);
  }
  return result;
}

TEST(DriveHeadline, SaysThatTheGoalIsReachedAndWhatWasKnown) {
  EXPECT_EQ(drive_headline(crossing(), driven(DriveOutcome::reached)),
            "The car reached its goal after 4.0 s and 30.0 m, at 7.5 m/s in the mean. It was sure "
            "of the cyclist from 2.0 s on, 1.0 s before it saw it directly. It was never nearer to "
            "anything than 0.50 m.");
}

TEST(DriveHeadline, SaysWhatWasHitAndHowFast) {
  DriveResult result = driven(DriveOutcome::collision);
  result.hit = "cyclist";
  result.clearance = 0;
  EXPECT_THAT(drive_headline(crossing(), result),
              AllOf(StartsWith("The car hit the cyclist at 18 km/h after 4.0 s and 30.0 m. "),
                    Not(HasSubstr("nearer"))));
}

TEST(DriveHeadline, SaysWhyItStandsOrThatTimeIsOver) {
  DriveResult result = driven(DriveOutcome::stopped);
  EXPECT_THAT(
      drive_headline(crossing(), result),
      StartsWith("The car stood still after 4.0 s and 30.0 m and gave up: no plan led on."));
  result.frames[2].braking_for = "cyclist";
  EXPECT_THAT(drive_headline(crossing(), result), HasSubstr("gave up: it braked for cyclist."));
  EXPECT_THAT(drive_headline(crossing(), driven(DriveOutcome::timeout)),
              StartsWith("Time was over after 4.0 s: the car had driven 30.0 m"));
}

TEST(DriveHeadline, DoesNotClaimKnowledge) {
  DriveResult result = driven(DriveOutcome::reached);
  for (DriveFrame& frame : result.frames) frame.mixture.reset();
  EXPECT_THAT(drive_headline(crossing(), result),
              HasSubstr("It saw the cyclist from 3.0 s on and was not sure before."));
  for (DriveFrame& frame : result.frames) frame.fate = FrameFate::used;
  EXPECT_THAT(drive_headline(crossing(), result), HasSubstr("It never was sure of the cyclist."));
  for (DriveFrame& frame : result.frames) frame.truth.reset();
  EXPECT_THAT(drive_headline(crossing(), result), HasSubstr("Nothing was hidden."));
  // Told with the first answer.
  result = driven(DriveOutcome::reached);
  result.frames[1].mixture->presence_probability = 1;
  EXPECT_THAT(drive_headline(crossing(), result),
              HasSubstr("It took the cyclist to be there from the start, 2.0 s before"));
}

TEST(DriveJson, NamesWhatWasHitAndWhenItWasSure) {
  DriveResult result = driven(DriveOutcome::collision);
  EXPECT_TRUE(drive_json(crossing(), {}, result)["hit"].is_null());
  result.hit = "cyclist";
  const nlohmann::json written = drive_json(crossing(), {}, result);
  EXPECT_EQ(written["hit"], "cyclist");
  EXPECT_EQ(written["headline"], drive_headline(crossing(), result));
  EXPECT_EQ(written["sure_from_s"], 2.0);
  result.frames[1].mixture->presence_probability = 1;
  EXPECT_TRUE(drive_json(crossing(), {}, result)["sure_from_s"].is_null());
}

TEST(TrueWorld, NamesWhatIsTouched) {
  Drive drive = crossing();
  drive.truth.present = 1;
  const TrueWorld world(drive, 1);
  EXPECT_EQ(world.touched(world.bodies(2).front(), 2), "cyclist");
  EXPECT_EQ(world.touched({{-20, -10}}, 2), "near building");
  EXPECT_EQ(world.touched({{-20, -2}}, 2), "");
}

}  // namespace
}  // namespace blindcorner
