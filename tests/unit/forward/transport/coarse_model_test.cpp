// SPDX-License-Identifier: Apache-2.0
/// Closed-form light against the fast model: what a search and a descent need of it.
#include "forward/transport/coarse_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "bundled.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

class CoarseLight : public testing::TestWithParam<std::string> {
 protected:
  CoarseLight()
      : scene_(bundled_scene(GetParam())),
        sensor_(sensor_placement(scene_)),
        coarse_(std::make_shared<const CoarseScene>(scene_), sensor_) {}

  Scene scene_;
  SensorPlacement sensor_;
  CoarseModel coarse_;
};

double dot(const HistogramCube& a, const HistogramCube& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) sum += a.values[i] * b.values[i];
  return sum;
}

// A matched filter with closed-form templates keeps most of its response, as it does half a grid
// step off (0.91): else the search would look at the wrong places first.
TEST_P(CoarseLight, IsAMatchedFilterForTheModels) {
  FastModelOptions options;
  options.tolerance = 0.1;
  const auto fast = make_fast_model(scene_, sensor_, options);
  std::mt19937_64 random(5);
  SparseLight light;
  double mean = 0;
  constexpr int kPoses = 8;
  for (int i = 0; i < kPoses; ++i) {
    const PoseVector pose = testing_scenes::random_pose(scene_, random);
    const HistogramCube right = fast->three_bounce(pose);
    coarse_.three_bounce(pose, 0, light);
    mean += dot(right, light.cube) / std::sqrt(dot(right, right) * dot(light.cube, light.cube)) /
            kPoses;
  }
  EXPECT_GT(mean, 0.91);
}

// Time gates are made from the bounds, so no pose may light a bin beyond them.
TEST_P(CoarseLight, StaysWithinItsReach) {
  const std::vector<SparseLight::Range> reach = coarse_.reach();
  std::mt19937_64 random(8);
  SparseLight light;
  for (int i = 0; i < 50; ++i) {
    coarse_.three_bounce(testing_scenes::random_pose(scene_, random), 0, light);
    for (std::size_t z = 0; z < reach.size(); ++z) {
      if (light.lit[z].begin == light.lit[z].end) continue;
      EXPECT_GE(light.lit[z].begin, reach[z].begin) << "zone " << z;
      EXPECT_LE(light.lit[z].end, reach[z].end) << "zone " << z;
    }
  }
}

// Bins outside of the ranges that are said to be lit hold nothing, also when a cube is used again.
TEST_P(CoarseLight, KnowsWhichBinsItLights) {
  std::mt19937_64 random(6);
  SparseLight light;
  for (int i = 0; i < 3; ++i) {
    coarse_.three_bounce(testing_scenes::random_pose(scene_, random), 0, light);
    for (int z = 0; z < light.cube.zones(); ++z) {
      const SparseLight::Range& lit = light.lit[static_cast<std::size_t>(z)];
      for (int k = 0; k < light.cube.bins; ++k) {
        if (k < lit.begin || k >= lit.end) {
          EXPECT_EQ(light.cube.zone(z)[k], 0);
        }
      }
    }
  }
}

// What is kept between poses does not depend on which came before.
TEST_P(CoarseLight, ForgetsTheLastPose) {
  std::mt19937_64 random(7);
  const PoseVector first = testing_scenes::random_pose(scene_, random);
  const PoseVector second = testing_scenes::random_pose(scene_, random);
  SparseLight light;
  coarse_.three_bounce(first, 0, light);
  const std::vector<double> before = light.cube.values;
  coarse_.three_bounce(second, 0, light);
  coarse_.three_bounce(first, 0, light);
  EXPECT_EQ(light.cube.values, before);
}

INSTANTIATE_TEST_SUITE_P(Scenes, CoarseLight,
                         testing::Values("tmf8828_wall", "denali_like", "robot_corridor",
                                         "reference_street_box"));

}  // namespace
}  // namespace blindcorner
