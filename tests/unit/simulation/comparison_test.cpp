// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <numeric>
#include <string>
#include <string_view>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "bundled.h"
#include "forward/support/quantile.h"
#include "unit/error_message.h"

namespace blindcorner {
namespace {

using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

ComparisonOptions few() {
  ComparisonOptions options;
  options.captures = 3;
  options.dataset.objects = 4;
  options.dataset.sensors = 2;
  return options;
}

const Condition& named(const std::vector<Condition>& conditions, std::string_view name) {
  for (const Condition& c : conditions) {
    if (c.name == name) return c;
  }
  throw Error("no condition " + std::string(name));
}

TEST(ComparisonConditions, ChangeWhatTheySayAndNothingElse) {
  const Scene scene = bundled_scene("tmf8828_wall");
  const std::vector<Condition> conditions = render_conditions(scene, few());
  std::vector<std::string> names;
  for (const Condition& c : conditions) names.push_back(c.name);
  EXPECT_THAT(names, ElementsAreArray(condition_names()));
  const std::vector<Capture>& trained = named(conditions, "trained positions").captures;
  ASSERT_EQ(trained.size(), 3u);
  for (const char* same : {"another albedo", "another size", "time zero off by half a bin",
                           "relay tilted by 2 degrees", "second object"}) {
    const Condition& c = named(conditions, same);
    EXPECT_NE(c.wrong, "") << same;
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(c.captures[i].truth, trained[i].truth) << same;
      EXPECT_NE(c.captures[i].counts.values, trained[i].counts.values) << same;
    }
  }
  for (const Capture& c : named(conditions, "positions outside of the grid").captures) {
    const bool x_outside = c.truth.at("x_m") < 0.15 || c.truth.at("x_m") > 0.38;
    const bool y_outside = c.truth.at("y_m") < 0.35 || c.truth.at("y_m") > 0.7;
    EXPECT_TRUE(x_outside || y_outside);
  }
  EXPECT_EQ(named(conditions, "a tenth of the photons").captures.front().exposures, 1);
}

TEST(ComparisonConditions, AreTheSameAtAnyNumberOfThreads) {
  const Scene scene = bundled_scene("tmf8828_wall");
  const auto all = render_conditions(scene, few());
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const auto again = render_conditions(scene, few());
  for (std::size_t c = 0; c < all.size(); ++c) {
    for (std::size_t i = 0; i < all[c].captures.size(); ++i) {
      EXPECT_EQ(all[c].captures[i].counts.values, again[c].captures[i].counts.values)
          << all[c].name;
    }
  }
}

TEST(ComparisonConditions, KeepObjectsOutOfSurfaces) {
  const Scene scene = bundled_scene("tmf8828_wall");
  PoseVector pose(4);
  pose << 0.28, 0.5, 1.05, 0;
  EXPECT_TRUE(clear_of_surfaces(scene, pose));
  pose[1] = 0.25;  // its edge of 0.1 m reaches into the partition, whose side is at 0.22 m
  EXPECT_FALSE(clear_of_surfaces(scene, pose));
}

TEST(ComparisonConditions, RefuseSeveralObjects) {
  Scene scene = bundled_scene("tmf8828_wall");
  scene.further_hidden.push_back(scene.hidden);
  EXPECT_THAT(message_of([&] { render_conditions(scene, few()); }), HasSubstr("found 2 objects"));
  ComparisonOptions one = few();
  one.captures = 1;
  EXPECT_THAT(message_of([&] { one.validate(); }), HasSubstr("captures"));
}

TEST(Comparison, IntervalOfAMedianHoldsItAsOftenAsItSays) {
  // Sign test: the 95 % interval of the median of 101 values spans the ranks 41 to 61, give or take
  // the bootstrap's own noise of a rank or two.
  std::vector<double> values;
  for (int i = 0; i < 101; ++i) values.push_back(i);
  const BootstrapInterval middle = bootstrap(values, median, 1);
  EXPECT_EQ(middle.value, 50);
  EXPECT_NEAR(middle.low, 40, 3);
  EXPECT_NEAR(middle.high, 60, 3);
  // The same captures: a constant difference has no spread, however far the values scatter.
  std::vector<double> shifted = values;
  for (double& v : shifted) v += 0.5;
  const BootstrapInterval difference = bootstrap_difference(shifted, values, median, 1);
  EXPECT_DOUBLE_EQ(difference.low, 0.5);
  EXPECT_DOUBLE_EQ(difference.high, 0.5);
}

TEST(Comparison, CapturesOfOnePlaceAreDrawnTogether) {
  // Nine captures each of eleven places, all with the same error: as good as eleven captures.
  std::vector<double> once, often;
  CaptureClusters places;
  for (int place = 0; place < 11; ++place) {
    once.push_back(place);
    for (int i = 0; i < 9; ++i) {
      often.push_back(place);
      places.push_back(static_cast<std::size_t>(place));
    }
  }
  const auto mean = [](const std::vector<double>& values) {
    return std::reduce(values.begin(), values.end()) / static_cast<double>(values.size());
  };
  const BootstrapInterval one = bootstrap(once, mean, 1);
  const BootstrapInterval together = bootstrap(often, mean, 1, places);
  const BootstrapInterval apart = bootstrap(often, mean, 1);
  EXPECT_DOUBLE_EQ(one.value, 5);
  EXPECT_NEAR(together.low, one.low, 1e-9);
  EXPECT_NEAR(together.high, one.high, 1e-9);
  EXPECT_LT(apart.high - apart.low, 0.5 * (one.high - one.low));
  // What has no answer is left out.
  once[3] = std::nan("");
  EXPECT_NEAR(bootstrap(once, median, 1).value, 5.5, 1e-12);
  EXPECT_TRUE(std::isnan(bootstrap(std::vector<double>{std::nan("")}, median, 1).value));
}

/// A method that is off by so much along x and in yaw, a turn apart.
ComparedMethod off_by(const std::string& name, double metres, double radians = 0) {
  return {name, "none", [metres, radians](const Capture& capture) {
            PoseVector pose(4);
            pose << capture.truth.at("x_m") + metres, capture.truth.at("y_m"),
                capture.truth.at("z_m"), capture.truth.at("yaw_rad") + radians + 2 * kPi;
            return MethodAnswer{pose, metres > 0.1 ? 0.99 : 0.5};
          }};
}

TEST(Comparison, SaysWhereAnotherMethodIsBetterAndCountsFailures) {
  const Scene scene = bundled_scene("tmf8828_wall");
  Condition condition{"tilted", "", "the relay is off", ""};
  for (int i = 0; i < 8; ++i) {
    Capture capture;
    capture.truth = {{"x_m", 0.2}, {"y_m", 0.5}, {"z_m", 1.0}, {"yaw_rad", -0.1 * i}};
    condition.captures.push_back(capture);
  }
  const std::vector<ComparedMethod> methods = {
      off_by("solver", 0.2, 0.1),
      off_by("other", 0.05, 0.1),
      off_by("worse", 0.4, 0.02),
      {"broken", "none", [](const Capture&) -> MethodAnswer { throw Error("no light"); }}};
  const auto answers = answer_all(methods, condition.captures);
  const ConditionFigures figures = compare(scene, condition, methods, answers, 1);
  ASSERT_EQ(figures.methods.size(), 4u);
  EXPECT_NEAR(figures.methods[0].position.value, 0.2, 1e-12);
  EXPECT_NEAR(figures.methods[1].mean_absolute[0].value, 0.05, 1e-12);
  EXPECT_NEAR(figures.methods[1].mean_absolute[3].value, 0.1, 1e-12) << "yaw counts modulo a turn";
  EXPECT_EQ(figures.methods[0].claim->share, 0);
  EXPECT_EQ(figures.methods[1].claim->share, 1);
  EXPECT_NEAR(figures.methods[1].against_first->value, -0.15, 1e-12);
  EXPECT_EQ(figures.methods[3].failures, 8);
  EXPECT_EQ(figures.methods[3].first_error, "no light");
  ASSERT_EQ(figures.findings.size(), 2u);
  EXPECT_THAT(figures.findings[0], HasSubstr("other has a smaller median error (0.0500 m)"));
  EXPECT_THAT(figures.findings[0], HasSubstr("the relay is off"));
  EXPECT_THAT(figures.findings[1],
              HasSubstr("worse has a smaller mean error of yaw (1.1459 degrees)"));
}

}  // namespace
}  // namespace blindcorner
