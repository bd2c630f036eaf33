// SPDX-License-Identifier: Apache-2.0
/// Rows about captures so bright that the model's own error decides.
#include <algorithm>
#include <cmath>
#include <random>

#include "blindcorner/forward/constants.h"
#include "blindcorner/simulation/synthetic.h"
#include "forward/support/parallel.h"
#include "stability/cases.h"
#include "stability/themes.h"

namespace blindcorner {
namespace {

const char* const kBrightTheme = "Bright captures";
constexpr int kPoses = 20;
/// Sampling twice as dense as usual. With the usual one, the reference renderer's light is 0.2 to
/// 0.5 % off where the partition cuts through it. Twice the density leaves a fifth of that.
constexpr double kSampling = 2;

/// Like tmf8828_wall: a partition hides some of the plate in some poses; x, y, z and yaw are
/// unknown.
Scene bright_scene() {
  Scene scene = partitioned_scene({0.635, 0.02, 2}, {0.0175, 0.22, 0});
  scene.unknowns = {{Component::x, 0.15, 0.38, std::nullopt},
                    {Component::y, 0.35, 0.7, std::nullopt},
                    {Component::z, -0.2, 0.2, std::nullopt},
                    {Component::yaw, -75 * kDegree, 30 * kDegree, std::nullopt}};
  return scene;
}

/// Poses drawn from the prior, and their light. Made once.
struct BrightPoses {
  Scene scene = bright_scene();
  std::vector<PoseVector> poses;
  std::vector<HistogramCube> light, known;

  BrightPoses() : light(kPoses), known(kPoses) {
    const auto model =
        make_reference_renderer(scene, sensor_placement(scene), reference_sampling(kSampling));
    std::mt19937_64 random(1);
    for (int i = 0; i < kPoses; ++i) poses.push_back(draw_pose(scene, random));
    model->static_background();
    parallel_for(std::size_t{0}, poses.size(), [&](std::size_t i) {
      light[i] = model->three_bounce(poses[i]);
      known[i] = model->shadowed_background(poses[i]);
    });
  }
};

const BrightPoses& bright_poses() {
  static const BrightPoses all;
  return all;
}

/// Largest squared distance of a true pose from the nearest mode of its fit.
StabilityMeasurement largest_distance(double photons) {
  const BrightPoses& bright = bright_poses();
  const Fitter fitter(bright.scene, without_empty_captures());
  std::vector<double> distances;
  for (std::size_t i = 0; i < bright.poses.size(); ++i) {
    const double exposures = photons / total_counts(bright.scene, bright.light[i]);
    const LinearValues linear{1.0, equal_ambient(bright.scene, bright.light[i]), 1.0};
    const Capture capture = capture_of_light(bright.scene, bright.light[i], bright.known[i], linear,
                                             exposures, 100 + i);
    const FitResult result = fitter.fit(capture);
    distances.push_back(mode_distance(bright.scene, result.posterior, bright.poses[i]));
  }
  const auto unlike = [](double d) { return !std::isfinite(d); };
  if (std::ranges::any_of(distances, unlike)) return {std::nan(""), "no mode"};
  std::ranges::sort(distances);
  return {distances.back(), "median " + std::to_string(distances[distances.size() / 2])};
}

StabilityRow bright_row(const std::string& name, double photons) {
  return {
      name,
      kBrightTheme,
      name.substr(name.rfind('_') + 1) +
          " photons of each of twenty poses, some behind a partition: largest of the squared "
          "distances of the truth from the nearest mode by its covariance",
      30,
      "1",
      LimitOrigin::physics,
      "Chi-squared of 4 unknowns; of twenty honest fits one is beyond 30 once in 10,000 tables.",
      [=] { return largest_distance(photons); }};
}

}  // namespace

std::vector<StabilityRow> bright_rows() {
  return {bright_row("photons_1e7", 1e7), bright_row("photons_1e9", 1e9),
          bright_row("photons_1e12", 1e12)};
}

}  // namespace blindcorner
