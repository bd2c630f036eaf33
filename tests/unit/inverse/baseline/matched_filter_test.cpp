// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/inverse/baseline/matched_filter.h"

#include <gtest/gtest.h>

#include "blindcorner/forward/error.h"
#include "blindcorner/inverse/baseline/back_projection.h"
#include "blindcorner/simulation/synthetic.h"
#include "bundled.h"

namespace blindcorner {
namespace {

// The answer is a pose of the grid: within a pulse's half width of the truth where light is ample,
// and no nearer than the grid allows, whichever way its histograms are made.
TEST(MatchedFilterBaseline, AnswersAPoseOfTheGridNearTheTruth) {
  const Scene scene = bundled_scene("denali_like");
  const auto renderer = make_reference_renderer(scene, sensor_placement(scene));
  const Eigen::Vector2d truth(1.14, 0.34);
  LightBudget budget;
  budget.third_bounce_photons = 20'000;
  const Capture capture = make_capture(scene, *renderer, truth, budget, 1);
  for (const bool closed_form : {true, false}) {
    MatchedFilterOptions options;
    options.closed_form = closed_form;
    const MatchedFilterBaseline filter(scene, options);
    const PoseVector pose = filter.predict(capture);
    EXPECT_LT((pose - truth).norm(), 0.05) << closed_form;
    EXPECT_EQ(pose, filter.predict(capture));
  }
}

TEST(MatchedFilterBaseline, AnswersTheMiddleOfThePriorWithoutLight) {
  const Scene scene = bundled_scene("denali_like");
  Capture dark;
  dark.counts = HistogramCube(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  EXPECT_EQ(MatchedFilterBaseline(scene).predict(dark), middle_of_prior(scene));
  EXPECT_THROW(MatchedFilterBaseline(scene, {0, true}), Error);
}

}  // namespace
}  // namespace blindcorner
