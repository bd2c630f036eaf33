// SPDX-License-Identifier: Apache-2.0
/// The fast model's error in the known scene's own light must not become an object's.
#include "inverse/likelihood/background_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>

#include "blindcorner/simulation/credible_level.h"
#include "bundled.h"
#include "forward/transport/scene_transport.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using namespace testing_scenes;

/// The wall's own light and that of its partition.
Scene wall(double albedo) {
  Scene scene = bundled_scene("tmf8828_wall");
  scene.surfaces.front().albedo = albedo;
  return scene;
}

Capture drawn(const Scene& scene, const HistogramCube& light, const HistogramCube& known,
              double exposures, std::uint64_t seed) {
  Capture capture;
  capture.source = "drawn";
  capture.exposures = exposures;
  capture.counts = draw_counts(
      scene, expected_counts(scene, light, known, {1.0, scene.linear.fixed_ambient, 1.0}),
      exposures, seed);
  return capture;
}

std::unique_ptr<CompiledScene> compiled_for_one_fit(const Scene& scene) {
  GridOptions grid;
  grid.closed_form = true;
  grid.max_poses = 200;
  return compile(scene, {sensor_placement(scene)}, {}, grid);
}

TEST(BackgroundError, WeighsBinsByThePhotonsShareOfWhatTheyMayBeOffBy) {
  const Scene scene = wall(0.97);
  const auto compiled = compiled_for_one_fit(scene);
  ASSERT_FALSE(compiled->background.error.empty());
  const HistogramCube nothing(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  const HistogramCube known = compiled->models().front()->static_background();
  for (const double exposures : {1.0, 100.0}) {
    const Capture capture = drawn(scene, nothing, known, exposures, 1);
    const Observation observation = observe(*compiled, {&capture, 1});
    std::size_t row = 0;
    for (const ObservedZone& zone : observation.zones) {
      for (int k = 0; k < zone.bins(); ++k, ++row) {
        const double photons =
            (compiled->background.light[row] + scene.linear.fixed_ambient) / exposures;  // Poisson
        const double error = std::pow(compiled->background.error[row], 2);
        // The level is smoothed over bins and fitted: no more than the half right where light
        // rises.
        EXPECT_GE(zone.weight_of(k), photons / (photons + error) - 0.02);
        if (k > 100) {
          EXPECT_NEAR(zone.weight_of(k), photons / (photons + error), 0.05);
        }
      }
    }
  }
}

TEST(BackgroundError, NegligibleOnesLeaveBinsAsTheyAre) {
  const Scene scene = wall(0.7);
  const auto compiled = compiled_for_one_fit(scene);
  const HistogramCube nothing(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  const HistogramCube known = compiled->models().front()->static_background();
  const Capture faint = drawn(scene, nothing, known, 1e-3, 1);
  for (const ObservedZone& zone : observe(*compiled, {&faint, 1}).zones) {
    EXPECT_TRUE(zone.weight.empty());
  }
}

// The usual one is 1.5e-4 off (L2 over photon noise), with errors that go together; that alone puts
// a plate centimetres away at a billion photons.
TEST(BackgroundError, OfBrightCapturesIsMended) {
  const Scene scene = wall(0.7);
  const auto compiled = compiled_for_one_fit(scene);
  const auto reference =
      make_reference_renderer(scene, sensor_placement(scene), reference_sampling(2));
  const HistogramCube nothing(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  const Capture bright = drawn(scene, nothing, reference->static_background(), 1e7, 1);
  const Observation observation = observe(*compiled, {&bright, 1});
  ASSERT_TRUE(observation.fine_background);
  const Capture dim = drawn(scene, nothing, reference->static_background(), 1, 1);
  EXPECT_FALSE(observe(*compiled, {&dim, 1}).fine_background);

  const HistogramCube dense = static_background(scene, reference->static_background());
  const GatedBackground& fine = compiled->fine_background();
  double usual_square = 0, fine_square = 0;
  std::size_t row = 0;
  for (int z = 0; z < dense.zones(); ++z) {
    const TimeGate& gate = compiled->gates.front()[static_cast<std::size_t>(z)];
    for (int k = gate.first; k < gate.end; ++k, ++row) {
      const double level = dense.zone(z)[k];
      if (!(level > 0)) continue;
      usual_square += std::pow(compiled->background.light[row] - level, 2) / level;
      fine_square += std::pow(fine.light[row] - level, 2) / level;
    }
  }
  EXPECT_LT(fine_square, usual_square / 4);
}

// A floor whose own light is eighty times the object's. Its squared error over its photon noise,
// summed over bins, is to a capture with N photons of the object N times this: below 1 for each
// bin up to some thousand photons. What is carried for it must be no less than it is.
TEST(BackgroundError, OfABrightCornerIsSmallAndCarried) {
  const Scene scene = bundled_scene("reference_floor_corner_light");
  const auto reference = make_reference_renderer(scene, sensor_placement(scene));
  const HistogramCube& dense = reference->static_background();
  const HistogramCube object = reference->three_bounce(stated_pose(scene));
  const double photons = std::accumulate(object.values.begin(), object.values.end(), 0.0);
  const auto compiled = compiled_for_one_fit(scene);
  const HistogramCube& fast = compiled->models().front()->static_background();
  double square = 0, carried = 0;
  std::size_t row = 0;
  for (int z = 0; z < fast.zones(); ++z) {
    const TimeGate& gate = compiled->gates.front()[static_cast<std::size_t>(z)];
    for (int k = gate.first; k < gate.end; ++k, ++row) {
      const double level = dense.zone(z)[k];
      if (!(level > 0)) continue;
      square += std::pow(fast.zone(z)[k] - level, 2) / level;
      carried += std::pow(compiled->background.error[row], 2) / level;
    }
  }
  EXPECT_LT(square / photons, 0.04);
  EXPECT_GT(carried, square);
}

// Some ten thousand photons from the object and more, and a wall that sends nearly all light on.
TEST(BackgroundError, OfABrightWallLeavesTheTruthInsideTheRegion) {
  const Scene scene = wall(0.97);
  const auto reference = make_reference_renderer(scene, sensor_placement(scene));
  const Fitter fitter(scene);
  std::mt19937_64 random(7);
  int inside = 0, misfits = 0;
  for (int i = 0; i < 10; ++i) {
    const PoseVector truth = random_pose(scene, random);
    const HistogramCube light = reference->three_bounce(truth);
    const HistogramCube known = reference->shadowed_background(truth);
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const FitResult result = fitter.fit(drawn(scene, light, known, 2000, seed));
      inside += credible_level(scene, result.posterior, truth) <= 0.95 ? 1 : 0;
      misfits += std::ranges::count(result.flags, "model_misfit") > 0 ? 1 : 0;
    }
  }
  EXPECT_GE(inside, 44);
  EXPECT_LE(misfits, 2);
}

TEST(BackgroundError, IsNoObjectHoweverBrightTheRoom) {
  const Scene scene = wall(0.7);
  const auto reference = make_reference_renderer(scene, sensor_placement(scene));
  const HistogramCube nothing(scene.sensor.rows, scene.sensor.columns, scene.sensor.bins);
  const Fitter fitter(scene);
  constexpr std::uint64_t kSeeds = 12;
  std::uint64_t alarms = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const FitResult result =
        fitter.fit(drawn(scene, nothing, reference->static_background(), 10'000, seed));
    EXPECT_LT(result.posterior.presence_probability, 0.5);
    if (std::ranges::count(result.flags, "nothing_detected") == 0) ++alarms;
  }
  // One in twenty is what the alarm allows itself: three of twelve are not exceeded in 0.998.
  EXPECT_LE(alarms, kSeeds / 4);
}

// Every frame of a moving sensor needs the light anew. Where the usual sampling takes long, a
// coarser one says by how much more it may be off, and no capture is so bright that a finer one is
// sampled after all.
TEST(BackgroundError, OfLightInTimeIsStated) {
  const Scene scene = bundled_scene("crossing_cyclist");
  const auto transport = make_scene_transport(scene);
  ASSERT_TRUE(transport->static_background()->any_coarser());
  SensorPlacement elsewhere = sensor_placement(scene);
  elsewhere.T_world_sensor.translation().x() -= 3;
  const auto background = [&](KnownLightSampling sampling) {
    FastModelOptions options;
    options.tolerance = kFirstTolerance;
    options.known_light = sampling;
    auto model = make_fast_model(transport, elsewhere, options);
    return std::pair{model->static_background(), total(model->background_error())};
  };
  const auto [usual, usual_error] = background(KnownLightSampling::usual);
  const auto [timely, timely_error] = background(KnownLightSampling::timely);
  const auto reference = make_reference_renderer(scene, elsewhere, reference_sampling(0.5));
  const HistogramCube truth = reference->static_background();
  const double little = 1e-4 * *std::ranges::max_element(usual.values);
  double difference = 0, stated = 0, stated_usually = 0, off = 0, off_usually = 0;
  for (std::size_t i = 0; i < usual.values.size(); ++i) {
    if (usual.values[i] < little) continue;
    const double noise = usual.values[i];
    difference += std::pow(timely.values[i] - usual.values[i], 2) / noise;
    stated += std::pow(timely_error.values[i], 2) / noise;
    stated_usually += std::pow(usual_error.values[i], 2) / noise;
    off += std::pow(timely.values[i] - truth.values[i], 2) / noise;
    off_usually += std::pow(usual.values[i] - truth.values[i], 2) / noise;
  }
  EXPECT_GT(stated, 2 * stated_usually);
  EXPECT_LT(stated, 16 * stated_usually);
  EXPECT_GT(off, off_usually);
  EXPECT_LT(off, stated);
  EXPECT_LT(off_usually, stated_usually);
  EXPECT_LT(difference, stated + stated_usually);
  EXPECT_GT(difference, 0.02 * stated);  // errors that go together are stated as larger ones

  FitOptions options;
  options.known_light = KnownLightSampling::timely;
  GridOptions grid;
  grid.closed_form = true;
  grid.max_poses = 200;
  const auto compiled = compile(scene, {elsewhere}, options, grid);
  EXPECT_EQ(&compiled->fine_background(), &compiled->background);
}

TEST(BackgroundError, IsAsUsualWhereLightTakesLittleTime) {
  const Scene scene = bundled_scene("aisle_crossing");
  const auto transport = make_scene_transport(scene);
  EXPECT_TRUE(transport->static_background()->any_bounces());
  EXPECT_FALSE(transport->static_background()->any_coarser());
}

}  // namespace
}  // namespace blindcorner
