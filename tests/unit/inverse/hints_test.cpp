// SPDX-License-Identifier: Apache-2.0
/// What the program sees that a user does not.
#include "blindcorner/inverse/hints.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "blindcorner/io/scene_file.h"
#include "bundled.h"

namespace blindcorner {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

std::vector<std::string> hints_of(const Scene& scene) {
  return scene_hints(scene, sensor_placement(scene));
}

/// The wall stands at x = 0.6 m and faces -x.
void put_x(Scene& scene, double lower, double upper) {
  scene.unknowns.front().lower = lower;
  scene.unknowns.front().upper = upper;
}

TEST(SceneHints, BundledScenesNeedNone) {
  for (const auto& file : std::filesystem::directory_iterator(SOURCE_DIR "/scenes")) {
    const std::string name = file.path().stem().string();
    if (file.path().extension() != ".json" || name.ends_with("_drive")) continue;
    const Scene scene = read_scene(file.path().string());
    const SensorPlacement sensor = sensor_placement(scene);
    bool known = true;  // some leave to captures where their zones look
    for (const auto& point : sensor.relay_points) known = known && point.allFinite();
    if (!known) continue;
    if (name == "aisle_crossing") {
      // People come from farther down the cross aisle than the module's ten metres of path.
      EXPECT_THAT(scene_hints(scene, sensor), ElementsAre(HasSubstr("after the last bin")));
      continue;
    }
    EXPECT_THAT(scene_hints(scene, sensor), IsEmpty()) << name;
  }
}

TEST(SceneHints, SearchRegionBehindTheRelay) {
  Scene scene = bundled_scene("tmf8828_wall");
  put_x(scene, 0.7, 0.9);
  EXPECT_THAT(hints_of(scene), ElementsAre(AllOf(StartsWith("All of the search region lies behind"),
                                                 HasSubstr("unknowns"))));
}

// Two of nine columns of places lie beyond the wall: 22 %.
TEST(SceneHints, PartOfTheSearchRegionBehindTheRelay) {
  Scene scene = bundled_scene("tmf8828_wall");
  put_x(scene, 0.6 - 0.7, 0.6 + 0.2);
  EXPECT_NEAR(region_reach(scene, sensor_placement(scene)).behind, 2.0 / 9, 1e-9);
  EXPECT_THAT(hints_of(scene), ElementsAre(StartsWith("22 % of the search region lies behind")));
}

TEST(SceneHints, SearchRegionOutOfTheSensorsTime) {
  Scene scene = bundled_scene("tmf8828_wall");
  // The last bin is over 2.4 ns after time zero: a path of 0.7 m, half the way to the wall and
  // back.
  for (Zone& zone : scene.sensor.zones) zone.last_valid_bin = 40;
  EXPECT_THAT(hints_of(scene), ElementsAre(AllOf(StartsWith("All of the search region"),
                                                 HasSubstr("after the last bin that is used"))));
  // The first bin begins 14 ns after time zero: a path of 4.2 m, longer than any here.
  for (Zone& zone : scene.sensor.zones) {
    zone.last_valid_bin = -1;
    zone.first_valid_bin = 70;
    zone.time_zero = -8e-9;
  }
  EXPECT_THAT(hints_of(scene), ElementsAre(HasSubstr("before the first bin that is used")));
}

TEST(SceneHints, PlacementBehindTheRelay) {
  const Scene scene = bundled_scene("tmf8828_wall");
  std::vector<Placement> placements = stated_placements(scene);
  EXPECT_THAT(placement_hints(scene, sensor_placement(scene), placements), IsEmpty());
  placements.front().position.x() = 0.8;
  EXPECT_THAT(placement_hints(scene, sensor_placement(scene), placements),
              ElementsAre(StartsWith("The object lies behind the relay surface")));
}

FitResult fit_of(double deviance, double measured, double model) {
  FitResult result;
  result.goodness_of_fit = {deviance, 1000, 45, deviance / 1000};
  FittedHistograms fitted;
  fitted.measured = fitted.model = fitted.object = HistogramCube(1, 1, 2);
  fitted.measured.values = {measured, measured};
  fitted.model.values = {model, model};
  fitted.zone_used = {true};
  fitted.end_bin = 2;
  result.histograms = {fitted};
  return result;
}

TEST(FitHints, GainsThatWereNeverCalibrated) {
  Scene scene = bundled_scene("tmf8828_wall");
  scene.linear.direct = LinearMode::fixed;
  EXPECT_THAT(fit_hints(scene, fit_of(1050, 100, 100)), IsEmpty());
  EXPECT_THAT(fit_hints(scene, fit_of(133'000, 400, 100)),
              ElementsAre(AllOf(HasSubstr("4 times as bright"), HasSubstr("never calibrated"),
                                HasSubstr("blindcorner calibrate"))));
  EXPECT_THAT(fit_hints(scene, fit_of(133'000, 100, 100)),
              ElementsAre(AllOf(HasSubstr("time zero"), HasSubstr("blindcorner calibrate"))));
}

// Without the direct return a pose takes up an error of time zero, and no misfit tells.
TEST(FitHints, TimeZeroThatNothingChecks) {
  Scene scene = bundled_scene("tmf8828_wall");
  FitResult result = fit_of(1000, 100, 100);
  const auto n = static_cast<Eigen::Index>(scene.unknowns.size());
  PoseMode mode;
  mode.covariance = 1e-6 * Eigen::MatrixXd::Identity(n, n);
  result.posterior.modes = {mode};
  EXPECT_THAT(fit_hints(scene, result), IsEmpty());
  scene.linear.direct = LinearMode::fixed;
  scene.linear.fixed_direct = 0;
  EXPECT_THAT(fit_hints(scene, result), ElementsAre(HasSubstr("checks time_zero_ps")));
  result.posterior.modes.front().covariance *= 1e6;
  EXPECT_THAT(fit_hints(scene, result), IsEmpty());
}

}  // namespace
}  // namespace blindcorner
