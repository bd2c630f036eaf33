// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/detection_study.h"

#include <gtest/gtest.h>

#include <random>

#include "bundled.h"

namespace blindcorner {
namespace {

// Of the six pairs the object scores higher in four, and equally in one.
TEST(RocCurve, GoesThroughAllThresholds) {
  const std::vector<double> with{3, 2, 1}, without{2, 0};
  const std::vector<RocPoint> curve = roc_curve(with, without);
  ASSERT_EQ(curve.size(), 5U);
  EXPECT_DOUBLE_EQ(curve[1].true_share, 1.0 / 3);
  EXPECT_DOUBLE_EQ(curve[1].false_share, 0);
  EXPECT_DOUBLE_EQ(curve[2].true_share, 2.0 / 3);
  EXPECT_DOUBLE_EQ(curve[2].false_share, 0.5);
  EXPECT_DOUBLE_EQ(curve.back().true_share, 1);
  EXPECT_DOUBLE_EQ(curve.back().false_share, 1);
  EXPECT_DOUBLE_EQ(area_below(curve), 4.5 / 6);
  EXPECT_DOUBLE_EQ(true_share_at(curve, 0.25), 0.5);
}

TEST(RocCurve, OfEqualScoresIsChance) {
  const std::vector<double> same(10, 1.0);
  EXPECT_DOUBLE_EQ(area_below(roc_curve(same, same)), 0.5);
  EXPECT_DOUBLE_EQ(true_share_at(roc_curve(same, same), 0.1), 0.1);
}

// Two normal distributions one standard deviation apart: the area is Phi(1 / sqrt 2) = 0.760; with
// 4000 of each its standard deviation is 0.005.
TEST(RocCurve, OfNormalScores) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> with, without;
  for (int i = 0; i < 4000; ++i) {
    with.push_back(1 + normal(random));
    without.push_back(normal(random));
  }
  EXPECT_NEAR(area_below(roc_curve(with, without)), 0.7602, 0.021);
}

TEST(DetectionStudy, FindsBrightObjectsAndJudgesTheStatedRate) {
  const Scene scene = bundled_scene("denali_like");
  DetectionOptions options;
  options.captures = 4;
  options.empty_captures = 12;
  options.photons = {3000};
  options.light = TrueLight::sensor;
  options.fit.importance_samples = 0;
  options.fit.max_starts = 2;
  std::vector<DetectionScene> study{study_detection(scene, options)};
  judge_study(study);
  const DetectionLevel& level = study.front().levels.front();
  EXPECT_EQ(level.failures, 0);
  ASSERT_EQ(level.claims.size(), 4U);
  EXPECT_EQ(level.claims[0].trials, 12);
  // Thousands of photons over an equal background stand out; half of the empty captures are below
  // their median with all but certainty in some of twelve.
  EXPECT_EQ(level.reported_with, 4);
  EXPECT_GT(area_below(level.by_false_alarm), 0.95);
  EXPECT_TRUE(level.claims[0].holds);
}

}  // namespace
}  // namespace blindcorner
