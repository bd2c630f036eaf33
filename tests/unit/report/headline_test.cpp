// SPDX-License-Identifier: Apache-2.0
/// The sentence at the top of a page says what was found, and nothing more.
#include "blindcorner/report/headline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "blindcorner/report/page.h"
#include "report/colours.h"
#include "report/html.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

/// A scene with unknown x, y and yaw.
Scene plane_scene() {
  Scene scene = testing_scenes::one_narrow_zone();
  scene.unknowns = {{Component::x, 0, 1, std::nullopt},
                    {Component::y, 0, 1, std::nullopt},
                    {Component::yaw, -1, 1, std::nullopt}};
  return scene;
}

PoseMode mode_at(double x, double y, double sigma, double weight) {
  PoseMode mode;
  mode.weight = weight;
  mode.pose = Eigen::Vector3d(x, y, 0.5);
  mode.covariance = Eigen::Vector3d(sigma * sigma, sigma * sigma, 0.01).asDiagonal();
  mode.optimum = mode.pose;
  return mode;
}

FitResult result_to_say(std::vector<PoseMode> modes) {
  FitResult result;
  result.sources = {"capture.exr"};
  result.indices = {0};
  result.posterior.modes = std::move(modes);
  result.posterior.presence_probability = 1;
  return result;
}

// 95 % of two independent coordinates lie within 2.45 of their common standard deviation.
TEST(Headline, SaysWhereTheObjectIsGiveOrTakeHowMuch) {
  const std::string text =
      fit_headline(plane_scene(), result_to_say({mode_at(0.307, 0.521, 0.02, 1)}));
  EXPECT_THAT(text, StartsWith("Found at x 0.31 m, y 0.52 m, give or take 5 cm"));
  EXPECT_THAT(text, HasSubstr("turned to 29 degrees, give or take 12"));
}

// A claim of 95 % holds 95 % of draws, whatever the covariance's shape: 4000 draws leave a standard
// deviation of 0.35 %, the gamma law instead of the exact one up to 1 %.
TEST(Headline, RadiusHoldsNineteenOfTwentyDraws) {
  const Scene scene = plane_scene();
  for (const double other : {1e-4, 0.3, 1.0}) {
    PoseMode mode = mode_at(0, 0, 1, 1);
    mode.covariance(1, 1) = other * other;
    const double radius = position_radius(scene, mode, 0);
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    int within = 0;
    for (int i = 0; i < 4000; ++i) {
      within += std::hypot(normal(random), other * normal(random)) < radius ? 1 : 0;
    }
    EXPECT_NEAR(within / 4000.0, 0.95, 0.02) << other;
  }
}

TEST(Headline, NothingFoundShowsNoPlace) {
  FitResult result = result_to_say({mode_at(0.3, 0.5, 0.02, 1)});
  result.flags = {"nothing_detected"};
  const std::string text = fit_headline(plane_scene(), result);
  EXPECT_THAT(text, AllOf(StartsWith("Nothing found"), Not(HasSubstr("0.3"))));
  EXPECT_FALSE(found_something(result));
}

TEST(Headline, SeveralModesAreSeveralPlaces) {
  const std::string text = fit_headline(
      plane_scene(), result_to_say({mode_at(0.3, 0.5, 0.02, 0.6), mode_at(0.8, 0.5, 0.02, 0.4)}));
  EXPECT_THAT(text, StartsWith("Two places explain the light: at x 0.30 m, y 0.50 m"));
  EXPECT_THAT(text, AllOf(HasSubstr("(60 %); or at x 0.80 m"), HasSubstr("(40 %)")));
}

TEST(Headline, OnePlaceAndUnlikelyOthersAreOnePlace) {
  const std::string text = fit_headline(
      plane_scene(), result_to_say({mode_at(0.3, 0.5, 0.02, 0.88), mode_at(0.8, 0.5, 0.02, 0.04),
                                    mode_at(1.2, 0.5, 0.02, 0.04), mode_at(1.6, 0.5, 0.02, 0.04)}));
  EXPECT_THAT(text, AllOf(StartsWith("One place explains the light: at x 0.30 m"),
                          HasSubstr("(88 %)"), Not(HasSubstr("0.80"))));
}

// Modes whose places cannot be told apart differ in something else, which is then said.
TEST(Headline, ModesAtOnePlaceAreSeveralAnswers) {
  PoseMode other = mode_at(0.31, 0.5, 0.02, 0.4);
  other.pose[2] = -0.5;
  const std::string text =
      fit_headline(plane_scene(), result_to_say({mode_at(0.3, 0.5, 0.02, 0.6), other}));
  EXPECT_THAT(text, AllOf(StartsWith("Two answers explain the light"), HasSubstr("turned to 29"),
                          HasSubstr("turned to -29")));
}

TEST(Headline, DoubtIsSaid) {
  FitResult result = result_to_say({mode_at(0.3, 0.5, 0.02, 1)});
  result.posterior.presence_probability = 0.7;
  EXPECT_THAT(fit_headline(plane_scene(), result), HasSubstr("may not be there"));
  result.posterior.modes.front().undetermined = {1};
  EXPECT_THAT(fit_headline(plane_scene(), result), HasSubstr("y left open"));
  result.posterior.presence_probability = 0.04;
  EXPECT_THAT(fit_headline(plane_scene(), result),
              StartsWith("Unsure: the probability that an object is there is 0.04."));
}

TEST(Headline, ManyCapturesAreCounted) {
  FitResult nothing = result_to_say({mode_at(0.3, 0.5, 0.02, 1)});
  nothing.flags = {"nothing_detected"};
  FitResult failed;
  failed.error = "damaged";
  const FitResult found = result_to_say({mode_at(0.3, 0.5, 0.02, 1)});
  EXPECT_EQ(fits_headline({found, found, nothing, failed}),
            "Found in 2 of 4 captures, nothing in 1, 1 could not be fitted.");
}

TEST(Pages, CarryTheSentenceDarkColoursAndTablesThatScroll) {
  const std::string page =
      plain_page("A <title>", "Found & lost.", "<table><tr><td>1</tr></table>");
  EXPECT_THAT(page, HasSubstr("<p class=\"headline\">Found &amp; lost.</p>"));
  EXPECT_THAT(page, HasSubstr("prefers-color-scheme: dark"));
  EXPECT_THAT(page, HasSubstr("<div class=\"wide\" tabindex=\"0\" role=\"group\" "
                              "aria-label=\"table\"><table><tr><td>1</tr></table></div>"));
  EXPECT_THAT(plain_page("", "", "<h2>All <i>\"errors\"</i></h2><table></table>"),
              HasSubstr("aria-label=\"table: All 'errors'\""));
  const std::string fit = result_page(plane_scene(), {result_to_say({mode_at(0.3, 0.5, 0.02, 1)})});
  EXPECT_THAT(fit, AllOf(HasSubstr("\"headline\":\"Found at x 0.30 m"),
                         HasSubstr("prefers-color-scheme: dark")));
}

TEST(Pages, OneThingHasOneColour) {
  EXPECT_EQ(colour::of_method("solver"), colour::kFound);
  EXPECT_EQ(colour::of_method("oracle"), colour::kTruth);
  EXPECT_NE(colour::of_series(0), colour::of_series(1));
}

}  // namespace
}  // namespace blindcorner
