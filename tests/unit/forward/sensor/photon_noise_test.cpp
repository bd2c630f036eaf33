// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/sensor/photon_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace blindcorner {
namespace {

Scene scene_of(int rows, int columns, int bins) {
  Scene scene;
  scene.sensor.rows = rows;
  scene.sensor.columns = columns;
  scene.sensor.bins = bins;
  scene.sensor.zones.resize(static_cast<std::size_t>(rows * columns));
  return scene;
}

struct Statistics {
  double mean = 0, variance = 0;
};

/// `count` independent draws of one expected value.
std::vector<double> draws(const Scene& like, double expected, double exposures, int count) {
  Scene scene = like;
  scene.sensor.bins = count;
  HistogramCube cube(1, 1, count);
  std::fill(cube.values.begin(), cube.values.end(), expected);
  return draw_counts(scene, cube, exposures, 7).values;
}

Statistics statistics(const std::vector<double>& values) {
  Statistics s;
  for (const double v : values) s.mean += v;
  s.mean /= static_cast<double>(values.size());
  for (const double v : values) s.variance += (v - s.mean) * (v - s.mean);
  s.variance /= static_cast<double>(values.size() - 1);
  return s;
}

constexpr int kDraws = 200000;
/// Standard errors that a fixed seed may be off by: one in 15 million.
constexpr double kSigmas = 5;

void expect_moments(const std::vector<double>& values, double mean, double variance,
                    double fourth_over_square) {
  const Statistics s = statistics(values);
  const auto n = static_cast<double>(values.size());
  EXPECT_NEAR(s.mean, mean, kSigmas * std::sqrt(variance / n));
  // Variance of the sample variance: (kurtosis - 1) / n of its square.
  EXPECT_NEAR(s.variance, variance, kSigmas * variance * std::sqrt((fourth_over_square - 1) / n));
}

// Poisson counts of k photons each worth 1/k: variance = dispersion * mean / exposures.
TEST(PhotonNoiseTest, PoissonVarianceIsDispersionTimesMeanOverExposures) {
  for (const double mean : {0.05, 3.0, 4000.0}) {
    for (const double dispersion : {1.0, 2.5}) {
      for (const double exposures : {1.0, 8.0}) {
        Scene scene = scene_of(1, 1, 1);
        scene.sensor.dispersion = dispersion;
        const double photons = mean * exposures / dispersion;
        expect_moments(draws(scene, mean, exposures, kDraws), mean, dispersion * mean / exposures,
                       3 + 1 / photons);
      }
    }
  }
}

TEST(PhotonNoiseTest, GaussianVarianceFollowsItsLaw) {
  Scene scene = scene_of(1, 1, 1);
  scene.sensor.noise = GaussianNoise{100.0, 15.0, false};
  for (const double mean : {0.0, 40.0, 1e4}) {
    for (const double exposures : {1.0, 4.0}) {
      expect_moments(draws(scene, mean, exposures, kDraws), mean, (100 + 15 * mean) / exposures, 3);
    }
  }
  // A negative expectation (background over-subtracted) has the floor's variance.
  expect_moments(draws(scene, -20, 1, kDraws), -20, 100, 3);
}

TEST(PhotonNoiseTest, AZoneMayHaveAFloorOfItsOwn) {
  Scene scene = scene_of(1, 2, kDraws);
  scene.sensor.noise = GaussianNoise{100.0, 15.0, false};
  scene.sensor.zones[1].variance_floor = 4;
  HistogramCube expected(1, 2, kDraws);
  std::fill(expected.values.begin(), expected.values.end(), 8.0);
  const HistogramCube counts = draw_counts(scene, expected, 1, 1);
  for (int z = 0; z < 2; ++z) {
    const double variance = (z == 0 ? 100 : 4) + 15 * 8.0;
    EXPECT_EQ(count_variance(scene.sensor, z, 8), variance);
    expect_moments({counts.zone(z), counts.zone(z) + kDraws}, 8, variance, 3);
  }
}

// Values below zero are stored as zero: as many as the normal law puts there, none negative.
TEST(PhotonNoiseTest, CensoringPutsTheLowerTailAtZero) {
  Scene scene = scene_of(1, 1, 1);
  scene.sensor.noise = GaussianNoise{100.0, 0.0, true};
  for (const double mean : {-5.0, 0.0, 8.0}) {
    const auto values = draws(scene, mean, 1, kDraws);
    EXPECT_GE(*std::min_element(values.begin(), values.end()), 0.0);
    const auto zeros = static_cast<double>(std::count(values.begin(), values.end(), 0.0));
    const double share = 0.5 * std::erfc(mean / 10 / std::sqrt(2.0));
    EXPECT_NEAR(zeros / kDraws, share, kSigmas * std::sqrt(share * (1 - share) / kDraws));
  }
}

TEST(PhotonNoiseTest, NeighbouringBinsAreIndependent) {
  Scene scene = scene_of(1, 1, 1);
  const auto values = draws(scene, 9.0, 1, kDraws);
  double covariance = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    covariance += (values[i] - 9) * (values[i - 1] - 9) / kDraws;
  }
  EXPECT_NEAR(covariance, 0, kSigmas * 9 / std::sqrt(kDraws));
}

TEST(PhotonNoiseTest, SameSeedSameCountsOtherSeedOthers) {
  Scene scene = scene_of(2, 2, 50);
  HistogramCube expected(2, 2, 50);
  for (std::size_t i = 0; i < expected.values.size(); ++i) {
    expected.values[i] = static_cast<double>(i % 17);
  }
  for (const NoiseModel& law :
       {NoiseModel(PoissonNoise{}), NoiseModel(GaussianNoise{4.0, 1.0, true})}) {
    scene.sensor.noise = law;
    const auto first = draw_counts(scene, expected, 2, 42).values;
    EXPECT_EQ(draw_counts(scene, expected, 2, 42).values, first);
    EXPECT_NE(draw_counts(scene, expected, 2, 43).values, first);
  }
}

TEST(PhotonNoiseTest, NoLightGivesNoCounts) {
  const Scene scene = scene_of(1, 1, 64);
  for (const double value : draws(scene, 0, 1, 64)) EXPECT_EQ(value, 0);
  // Nor does a rounding error below zero, which would not be a count.
  for (const double value : draws(scene, -1e-16, 1, 64)) EXPECT_EQ(value, 0);
}

// gain (a S + b static) + ambient, zone by zone.
TEST(PhotonNoiseTest, ExpectedCountsAreTheLinearModel) {
  Scene scene = scene_of(1, 3, 2);
  scene.sensor.zones[0].gain = 10;
  scene.sensor.zones[1].gain = 20;
  scene.sensor.zones[2].dead = true;
  HistogramCube object(1, 3, 2);
  HistogramCube direct(1, 3, 2);
  object.values = {1, 2, 3, 4, 5, 6};
  direct.values = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  LinearValues linear;
  linear.amplitude = 2;
  linear.direct = 5;
  linear.ambient = 7;
  const HistogramCube counts = expected_counts(scene, object, direct, linear);
  const std::vector<double> want = {10 * (2 * 1 + 5 * 0.1) + 7,
                                    10 * (2 * 2 + 5 * 0.2) + 7,
                                    20 * (2 * 3 + 5 * 0.3) + 7,
                                    20 * (2 * 4 + 5 * 0.4) + 7,
                                    0,
                                    0};
  ASSERT_EQ(counts.values.size(), want.size());
  for (std::size_t i = 0; i < want.size(); ++i) EXPECT_NEAR(counts.values[i], want[i], 1e-12);
}

// What is measured comes on top of what is known, with a fixed scale in it and a free one not.
TEST(PhotonNoiseTest, StaticLightIsTheDirectReturnAndTheMeasuredBackground) {
  Scene scene = scene_of(1, 2, 3);
  scene.sensor.zones[0].gain = 10;
  scene.sensor.zones[1].gain = 20;
  HistogramCube direct(1, 2, 3);
  direct.values = {1, 2, 0, 3, 4, 0};
  scene.linear.direct = LinearMode::fixed;
  scene.linear.fixed_direct = 0;
  EXPECT_FALSE(has_static_background(scene));
  scene.sensor.zones[1].background = {0.5, 0, -0.25};
  EXPECT_TRUE(has_static_background(scene));
  EXPECT_EQ(static_background(scene, direct).values, (std::vector<double>{0, 0, 0, 0.5, 0, -0.25}));
  scene.linear.fixed_direct = 0.5;
  EXPECT_EQ(static_background(scene, direct).values,
            (std::vector<double>{5, 10, 0, 30.5, 40, -0.25}));
  scene.linear.direct = LinearMode::per_zone;
  EXPECT_EQ(static_background(scene, direct).values,
            (std::vector<double>{10, 20, 0, 60.5, 80, -0.25}));

  const HistogramCube nothing(1, 2, 3);
  const HistogramCube counts = expected_counts(scene, nothing, nothing, {0, 7, 1, 2});
  EXPECT_EQ(counts.values, (std::vector<double>{7, 7, 7, 8, 7, 6.5}));
}

}  // namespace
}  // namespace blindcorner
