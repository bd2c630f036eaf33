// SPDX-License-Identifier: Apache-2.0
/// The measured law of brightness, and what captures of several phases need: each zone's own wrap,
/// exposures and ambient light.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "bundled.h"
#include "inverse/likelihood/linear_unknowns.h"
#include "inverse/likelihood/observation.h"

namespace blindcorner {
namespace {

double total(const HistogramCube& cube, int zone) {
  return std::accumulate(cube.zone(zone), cube.zone(zone) + cube.bins, 0.0);
}

TEST(MeasuredLaw, FallsAsItSaysAndArrivesWhenItShould) {
  const Scene scene = bundled_scene("cheapspad_mirrors");
  const auto model = make_fast_model(scene, sensor_placement(scene));
  const Eigen::Vector3d q(0.1, -1.1, 1.2);
  const HistogramCube light = model->three_bounce(q);
  const Eigen::Vector3d sensor = scene.T_world_sensor.translation();
  for (int z = 0; z < 8; ++z) {
    const auto& zone = scene.sensor.zones[static_cast<std::size_t>(z)];
    const auto spot = std::get<Eigen::Vector3d>(zone.footprint);
    const double d = (q - spot).norm();
    const double cosine = 1.1 / d;  // the wall is y = 0
    EXPECT_NEAR(total(light, z) / (std::pow(cosine, 7) * std::pow(d, -2.1)), 1, 1e-3) << z;
    // First moment: the pulse is symmetric; the table's steps and cut tails are worth 1 mm.
    double moment = 0;
    for (int b = 0; b < light.bins; ++b) moment += (b + 0.5) * light.zone(z)[b];
    const double arrival = (zone.time_zero + 2 * (d + (spot - sensor).norm()) / kSpeedOfLight) /
                           scene.sensor.bin_width;
    EXPECT_NEAR(moment / total(light, z), arrival, 1e-2) << z;
  }
  // The reference renderer has nothing finer to say.
  const HistogramCube reference =
      make_reference_renderer(scene, sensor_placement(scene))->three_bounce(q);
  EXPECT_EQ(reference.values, light.values);
}

// The wall's normal is -y, so the axes along it are x and z.
TEST(MeasuredLaw, AxisMayLeanAgainstTheNormal) {
  Scene scene = bundled_scene("cheapspad_mirrors");
  auto& law = std::get<MeasuredLawMaterial>(scene.hidden.material);
  law.axis_across = 0.1;
  law.axis_up = -0.05;
  const Eigen::Vector3d q(0.1, -1.1, 1.2);
  const HistogramCube light = make_fast_model(scene, sensor_placement(scene))->three_bounce(q);
  const Eigen::Vector3d axis = Eigen::Vector3d(0.1, -1, -0.05).normalized();
  for (int z = 0; z < 8; ++z) {
    const auto& zone = scene.sensor.zones[static_cast<std::size_t>(z)];
    const Eigen::Vector3d way = q - std::get<Eigen::Vector3d>(zone.footprint);
    const double d = way.norm();
    EXPECT_NEAR(total(light, z) / (std::pow(way.dot(axis) / d, 7) * std::pow(d, -2.1)), 1, 1e-3);
  }
}

TEST(MeasuredLaw, NeedsRelayPoints) {
  Scene scene = bundled_scene("cheapspad_mirrors");
  for (Zone& zone : scene.sensor.zones) zone.footprint = AngularRectangle{-0.1, 0.1, -0.1, 0.1};
  EXPECT_THROW(make_fast_model(scene, sensor_placement(scene)), Error);
}

TEST(ZoneWrap, EachZoneHasItsOwn) {
  Scene scene = bundled_scene("cheapspad_mirrors");
  scene.sensor.zones[0].wrap_bins = 10;  // zone 1 is the same spot
  const HistogramCube light = make_fast_model(scene, sensor_placement(scene))
                                  ->three_bounce(Eigen::Vector3d(0.1, -1.1, 1.2));
  for (int b = 0; b < 10; ++b) {
    EXPECT_DOUBLE_EQ(light.zone(0)[b], light.zone(1)[b] + light.zone(1)[b + 10]) << b;
  }
  for (int b = 10; b < 20; ++b) EXPECT_EQ(light.zone(0)[b], 0) << b;
}

/// One zone of ten bins that hold ambient light alone.
Observation dark(const Scene& scene, const Capture& capture) {
  std::vector<TimeGate> gates(8);
  gates[2] = {0, 10};
  return observe(scene, {&capture, 1}, {gates});
}

// Mean of ten bins at 7 with variance 4 / 5 each, prior 10 with sigma 0.5: weights 12.5 and 4.
TEST(AmbientPrior, IsWeighedAgainstTheBins) {
  Scene scene = bundled_scene("cheapspad_mirrors");
  scene.sensor.noise = GaussianNoise{.variance_floor = 4, .variance_per_count = 0};
  for (Zone& zone : scene.sensor.zones) zone.first_valid_bin = 0;
  scene.linear.ambient_prior.assign(8, {10, 0.5});
  Capture capture;
  capture.counts = HistogramCube(4, 2, 24);
  std::fill(capture.counts.values.begin(), capture.counts.values.end(), 7.0);
  capture.zone_exposures.emplace(8, 5.0);
  const Observation observation = dark(scene, capture);
  EXPECT_DOUBLE_EQ(observation.noise_model(observation.zones.front()).variance(7), 4.0 / 5);
  const LinearSolver solver(observation, scene.linear);
  LinearSolution solution;
  solver.solve(std::vector<ZoneShapes>(1), solution, false);
  EXPECT_NEAR(solution.ambient[0], (12.5 * 7 + 4 * 10) / 16.5, 1e-9);
  std::vector<double> residuals(static_cast<std::size_t>(solver.residual_count()));
  solver.residuals(std::vector<ZoneShapes>(1), solution, residuals.data());
  double squares = 0;
  for (const double r : residuals) squares += r * r;
  // 16.5 / (12.5 * 4) of the squared difference is what no value explains.
  EXPECT_NEAR(squares, 9 * 12.5 * 4 / 16.5, 1e-6);
}

TEST(ZoneExposures, AZoneWithoutDataSaysNothing) {
  Scene scene = bundled_scene("cheapspad_mirrors");
  for (Zone& zone : scene.sensor.zones) zone.first_valid_bin = 0;
  Capture capture;
  capture.counts = HistogramCube(4, 2, 24);
  capture.zone_exposures.emplace(8, 5.0);
  (*capture.zone_exposures)[2] = 0;
  EXPECT_NO_THROW(check_capture(scene, capture));
  const Observation observation = dark(scene, capture);
  EXPECT_GT(observation.noise_model(observation.zones.front()).variance(100), 1e6);
  capture.zone_exposures->pop_back();
  EXPECT_THROW(check_capture(scene, capture), Error);
}

}  // namespace
}  // namespace blindcorner
