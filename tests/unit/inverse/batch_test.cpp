// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/batch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using namespace testing_scenes;
using testing::ElementsAre;
using testing::HasSubstr;

Capture capture_at(const Scene& scene, double x) {
  Capture capture;
  capture.counts = HistogramCube(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  capture.T_world_sensor = at({x, 0, 0});
  capture.source = "file";
  return capture;
}

TEST(Batch, BinsOfAnotherWidthAreTold) {
  EXPECT_EQ(bin_width_problem(0, 88e-12), "");
  EXPECT_EQ(bin_width_problem(88.5e-12, 88e-12), "");
  EXPECT_THAT(bin_width_problem(100e-12, 88e-12),
              HasSubstr("bin_width_ps: found 100, accepted: the scene's 88"));
}

TEST(Batch, CapturesOfEachPlacementAreCounted) {
  Scene scene = one_narrow_zone();
  const Capture a = capture_at(scene, 0), b = capture_at(scene, 0), c = capture_at(scene, 1);
  FitOptions options;
  const Capture* const two_places[] = {&a, &b, nullptr, &c};
  EXPECT_EQ(suit_captures(two_places, scene.sensor, options), "");
  EXPECT_EQ(options.captures_per_placement, 1);  // 3 / 2
  const Capture* const one_place[] = {&a, &b};
  suit_captures(one_place, scene.sensor, options);
  EXPECT_EQ(options.captures_per_placement, 2);
}

TEST(Batch, AFitThatFailsIsNamed) {
  const Scene scene = one_narrow_zone();
  const Fitter fitter(scene);
  Capture wrong = capture_at(scene, 0);
  wrong.counts.values.front() = -1;
  wrong.index = 3;
  wrong.truth = {{"x_m", 1}};
  const FitResult result = fit_named(fitter, wrong);
  EXPECT_NE(result.error, "");
  EXPECT_THAT(result.sources, ElementsAre("file"));
  EXPECT_THAT(result.indices, ElementsAre(3));
  EXPECT_EQ(result.truth.at("x_m"), 1);
  const std::vector<Capture> both{wrong, wrong};
  EXPECT_THAT(fit_joint_named(fitter, both).indices, ElementsAre(3, 3));
}

TEST(Batch, WhatProgressThrowsThatIsNoExceptionIsNoError) {
  struct Enough {};
  FitOptions options;
  options.progress = [](const char* /*doing*/, double /*share*/) { throw Enough{}; };
  const Scene scene = one_narrow_zone();
  const Fitter fitter(scene, options);
  EXPECT_THROW(fit_named(fitter, capture_at(scene, 0)), Enough);
}

}  // namespace
}  // namespace blindcorner
