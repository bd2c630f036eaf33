// SPDX-License-Identifier: Apache-2.0
#include "inverse/search/compiled_scene.h"

#include <gtest/gtest.h>

#include <string>

#include "blindcorner/forward/constants.h"
#include "bundled.h"

namespace blindcorner {
namespace {

std::unique_ptr<CompiledScene> compiled(const Scene& scene) {
  GridOptions grid;
  grid.closed_form = true;
  grid.max_poses = 100;
  return compile(scene, {sensor_placement(scene)}, FitOptions{}, grid);
}

// A level that is no finer than the one before moves nothing, and what moves nothing passes for
// exact: lobes that are summed as pairs from the first level on had four levels alike.
TEST(ModelLevels, OfWideLobesAreEachFinerThanTheLast) {
  Scene scene = bundled_scene("tmf8828_wall");
  scene.hidden.material = RetroreflectiveMaterial{8 * kDegree};
  const auto known = compiled(scene);
  ASSERT_TRUE(known->models_at(0).front()->sampling_step()->lobe_pairs);
  for (int level = 1; level < kModelLevels; ++level) {
    const SamplingStep before = *known->models_at(level - 1).front()->sampling_step();
    const SamplingStep now = *known->models_at(level).front()->sampling_step();
    EXPECT_LT(now.relay, before.relay) << "level " << level;
    EXPECT_LT(now.object, before.object) << "level " << level;
  }
}

// Cells as small from the first level on left the partition's shadow on the plate where it was,
// with 0.3 to 0.6 % of the light, at every level.
TEST(ModelLevels, OfAMattObjectEndWithFinerCellsOnIt) {
  const auto known = compiled(bundled_scene("tmf8828_wall"));
  const ModelSize first = known->models_at(1).front()->size().value();
  const ModelSize last = known->models_at(kModelLevels - 1).front()->size().value();
  EXPECT_GE(last.object_points, 2 * first.object_points);
}

// Sums over patches of a matt object are cheap at every level and count for nothing.
TEST(ModelLevels, OfPairsThatCostMoreThanAskedAreLeftOut) {
  Scene scene = bundled_scene("tmf8828_wall");
  const auto matt = compiled(scene);
  EXPECT_EQ(matt->models_within(1, 1), &matt->models_at(1));
  scene.hidden.material = RetroreflectiveMaterial{8 * kDegree};
  const auto lobes = compiled(scene);
  const ModelSize size = lobes->models_at(1).front()->size().value();
  const double paths = static_cast<double>(size.lit_points) * size.seen_points * size.object_points;
  EXPECT_EQ(lobes->models_within(1, paths), &lobes->models_at(1));
  EXPECT_EQ(lobes->models_within(1, paths - 1), nullptr);
}

// A pulse as wide as the search region asked for four or five places along each axis, 320 poses
// here, and a wedge's light, which turns with its yaw, was never looked at where it was.
TEST(ClosedFormTemplates, AreAsManyAsMayBeWhateverThePulse) {
  for (const double sigma : {0.1e-9, 3e-9}) {
    Scene scene = bundled_scene("tmf8828_wall");
    scene.sensor.response = ImpulseResponse(GaussianResponse{sigma});
    GridOptions grid;
    grid.closed_form = true;
    grid.max_poses = 600;
    const auto known = compile(scene, {sensor_placement(scene)}, FitOptions{}, grid);
    EXPECT_LE(known->poses.size(), 600U) << sigma;
    EXPECT_GE(known->poses.size(), 410U) << sigma;  // 600 over 1.1^4, a step of four axes
  }
}

// A tracked frame scores nothing and should not pay for it.
TEST(ClosedFormTemplates, AreRenderedWhenSomebodyAsks) {
  const auto known = compiled(bundled_scene("tmf8828_wall"));
  const std::size_t before = known->bytes();
  EXPECT_EQ(known->templates().poses(), known->poses.size());
  EXPECT_EQ(known->bytes(), before + known->templates().bytes());
}

}  // namespace
}  // namespace blindcorner
