// SPDX-License-Identifier: Apache-2.0
/// What the detector does to the light: pile-up, saturation, crosstalk.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/photon_noise.h"
#include "inverse/likelihood/observation.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using namespace testing_scenes;

std::vector<double> bright_histogram() {
  std::vector<double> counts(40);
  for (std::size_t k = 0; k < counts.size(); ++k) {
    const double x = (static_cast<double>(k) - 8) / 2;
    counts[k] = 20 + 3000 * std::exp(-0.5 * x * x) + (k == 25 ? 400 : 0);
  }
  return counts;
}

// Photon by photon: in each cycle, Poisson photons in every bin, the first one is recorded.
TEST(PileUp, AgreesWithFirstPhotonsDrawnOneByOne) {
  constexpr double kCycles = 10000;
  const std::vector<double> light = bright_histogram();
  std::vector<double> expected = light;
  pile_up(kCycles, expected.data(), static_cast<int>(expected.size()));
  std::mt19937_64 random(7);
  std::vector<double> counts(light.size(), 0.0);
  constexpr int kRepeats = 60;
  for (int cycle = 0; cycle < kRepeats * static_cast<int>(kCycles); ++cycle) {
    for (std::size_t k = 0; k < light.size(); ++k) {
      std::poisson_distribution<int> photons(light[k] / kCycles);
      if (photons(random) == 0) continue;
      counts[k] += 1.0 / kRepeats;
      break;
    }
  }
  double chi = 0;
  for (std::size_t k = 0; k < light.size(); ++k) {
    const double p = expected[k] / kCycles;
    chi += std::pow(counts[k] - expected[k], 2) / (kCycles * p * (1 - p) / kRepeats);
  }
  // Chi square of 40 bins (multinomial, nearly free): mean 40, standard deviation 9.
  EXPECT_LT(chi, 40 + 5 * 9);
  EXPECT_LT(expected[25], 0.7 * light[25]) << "early light hides late light";
}

TEST(PileUp, CoatesCorrectionUndoesIt) {
  const std::vector<double> light = bright_histogram();
  std::vector<double> counts = light;
  const int bins = static_cast<int>(counts.size());
  pile_up(8000, counts.data(), bins);
  std::vector<double> corrected(light.size()), live(light.size());
  undo_pile_up(8000, counts.data(), bins, corrected.data(), live.data());
  for (std::size_t k = 0; k < light.size(); ++k) {
    EXPECT_NEAR(corrected[k], light[k], 1e-9 * light[k]);
    EXPECT_NEAR(live[k], counts[k] / light[k], 1e-9);
  }
  // A faint scene is left as it is: the loss is about the photons per cycle.
  std::vector<double> faint = light;
  pile_up(1e9, faint.data(), bins);
  for (std::size_t k = 0; k < light.size(); ++k) EXPECT_NEAR(faint[k], light[k], 1e-4 * light[k]);
}

// A detector that fires in every cycle: finite numbers, no light left over.
TEST(PileUp, FullDetectorStaysFinite) {
  const std::vector<double> counts = {100, 0, 0};
  std::vector<double> corrected(3), live(3);
  undo_pile_up(100, counts.data(), 3, corrected.data(), live.data());
  EXPECT_TRUE(std::isfinite(corrected[0]));
  EXPECT_GT(corrected[0], 100.0);
  EXPECT_EQ(corrected[1], 0.0);
  EXPECT_GT(live[1], 0.0);
}

Scene one_row_scene(int bins) {
  Scene scene = one_narrow_zone();
  scene.sensor.bins = bins;
  return scene;
}

// Draws have the expected mean and, because cycles run out, less than Poisson variance.
TEST(PileUp, DrawnCountsAreBinomialGivenTheEarlierOnes) {
  Scene scene = one_row_scene(40);
  scene.sensor.pile_up_cycles = 5000;
  HistogramCube expected(1, 1, 40);
  expected.values = bright_histogram();
  pile_up(5000, expected.values.data(), 40);
  std::vector<double> first(40, 0.0), second(40, 0.0);
  constexpr int kPiledUpDraws = 4000;
  for (int i = 0; i < kPiledUpDraws; ++i) {
    const HistogramCube counts = draw_counts(scene, expected, 1, static_cast<std::uint64_t>(i));
    for (std::size_t k = 0; k < 40; ++k) {
      first[k] += counts.values[k] / kPiledUpDraws;
      second[k] += counts.values[k] * counts.values[k] / kPiledUpDraws;
    }
  }
  for (std::size_t k = 0; k < 40; ++k) {
    const double p = expected.values[k] / 5000;
    const double variance = 5000 * p * (1 - p);  // of a multinomial's bin
    EXPECT_NEAR(first[k], expected.values[k], 5 * std::sqrt(variance / kPiledUpDraws));
    EXPECT_NEAR(second[k] - first[k] * first[k], variance,
                5 * variance * std::sqrt((2 + 1 / variance) / kPiledUpDraws));
  }
}

// What a fit sees: the light without pile-up, with the exposure that was left for it; and nothing
// of this when the sensor counts so few photons that none hides another.
TEST(PileUp, FitsSeeTheLightWithoutIt) {
  Scene scene = one_row_scene(40);
  scene.sensor.pile_up_cycles = 30000;
  Capture capture;
  capture.counts = HistogramCube(1, 1, 40);
  capture.counts.values = bright_histogram();
  pile_up(30000, capture.counts.values.data(), 40);
  const std::vector<std::vector<TimeGate>> gates = {{{0, 40}}};
  const Observation observation = observe(scene, std::span(&capture, 1), gates);
  const std::vector<double> light = bright_histogram();
  for (std::size_t k = 0; k < 40; ++k) {
    EXPECT_NEAR(observation.zones[0].counts[k], light[k], 1e-9 * light[k]);
  }
  EXPECT_LT(observation.likelihood[0]->scale(), 0.75);
  EXPECT_GT(observation.likelihood[0]->scale(), 0.5);
  scene.sensor.pile_up_cycles = 1e9;
  EXPECT_EQ(observe(scene, std::span(&capture, 1), gates).zones[0].counts, capture.counts.values);
}

TEST(Saturation, CutsWhatABinCanHold) {
  Scene scene = one_row_scene(2);
  scene.sensor.saturation = 1000;
  HistogramCube expected(1, 1, 2);
  expected.values = {1e6, 10};
  const HistogramCube counts = draw_counts(scene, expected, 1, 3);
  EXPECT_EQ(counts.values[0], 1000.0);
  EXPECT_LT(counts.values[1], 100.0);
}

// 200 captures of three zones: bins that are full in all of them, in 12, in 1, and everywhere.
TEST(Saturation, BinsThatCapturesFillUpAreNotValid) {
  Sensor sensor = one_row_scene(10).sensor;
  sensor.columns = 3;
  sensor.zones.assign(3, sensor.zones[0]);
  sensor.saturation = 1000;
  std::vector<Capture> captures(200);
  std::vector<const Capture*> pointers;
  for (std::size_t c = 0; c < captures.size(); ++c) {
    HistogramCube& counts = captures[c].counts = HistogramCube(1, 3, 10);
    std::ranges::fill(counts.values, 10.0);
    counts.zone(0)[2] = counts.zone(0)[3] = 1000;
    if (c < 12) counts.zone(1)[7] = 1000;
    if (c == 14) counts.zone(1)[5] = 1000;
    for (int k = 0; k < 10; ++k) counts.zone(2)[k] = 1000;
    pointers.push_back(&captures[c]);
  }
  const std::string said = leave_out_saturated_bins(sensor, pointers);
  EXPECT_THAT(said, testing::HasSubstr("17 bins of 3 zones"));
  EXPECT_THAT(said, testing::HasSubstr("nothing is left of 1 zones"));
  EXPECT_EQ(sensor.zones[0].first_valid_bin, 4);
  EXPECT_EQ(sensor.valid_end(0), 10);
  EXPECT_EQ(sensor.zones[1].first_valid_bin, 0);
  EXPECT_EQ(sensor.valid_end(1), 7);
  EXPECT_TRUE(sensor.zones[2].dead);
  EXPECT_EQ(leave_out_saturated_bins(sensor, pointers), "") << "nothing more is left out";
  Scene scene;
  scene.sensor = sensor;
  EXPECT_FALSE(saturates(sensor, captures[0]));
  EXPECT_NO_THROW(check_capture(scene, captures[0]));
  EXPECT_TRUE(saturates(sensor, captures[14]));
  EXPECT_THROW(check_capture(scene, captures[14]), Error);
}

/// Two zones side by side on a wall.
Scene two_zones() {
  Scene scene = one_narrow_zone();
  scene.sensor.columns = 2;
  scene.sensor.zones.assign(2, scene.sensor.zones[0]);
  scene.sensor.zones[0].footprint = AngularRectangle{-0.3, -0.01, -0.1, 0.1};
  scene.sensor.zones[1].footprint = AngularRectangle{0.01, 0.3, -0.1, 0.1};
  scene.sensor.field = field_of(40, 40);
  scene.hidden.shape = RectangleShape{0.1, 0.1};
  return scene;
}

TEST(Crosstalk, MixesZonesInBothModels) {
  for (const bool fast : {false, true}) {
    Scene scene = two_zones();
    const auto clean = model_of(scene, fast);
    scene.sensor.crosstalk = {0.9, 0.2, 0.1, 0.8};
    const auto mixed = model_of(scene, fast);
    const HistogramCube a = clean->three_bounce(stated_pose(scene));
    const HistogramCube b = mixed->three_bounce(stated_pose(scene));
    const double peak = *std::max_element(a.values.begin(), a.values.end());
    for (int k = 0; k < a.bins; ++k) {
      EXPECT_NEAR(b.zone(0)[k], 0.9 * a.zone(0)[k] + 0.2 * a.zone(1)[k], 1e-9 * peak);
      EXPECT_NEAR(b.zone(1)[k], 0.1 * a.zone(0)[k] + 0.8 * a.zone(1)[k], 1e-9 * peak);
    }
    EXPECT_NEAR(sum(mixed->static_background()), sum(clean->static_background()),
                0.1 * sum(clean->static_background()));
  }
}

// Light of the other zone arrives on the receiving zone's clock.
TEST(Crosstalk, KeepsTheReceivingZonesClock) {
  Scene scene = two_zones();
  scene.sensor.crosstalk = {1, 0, 1, 0};  // both zones record the light of the first
  scene.sensor.zones[1].time_zero = scene.sensor.zones[0].time_zero + 3 * scene.sensor.bin_width;
  const HistogramCube light = model_of(scene, false)->three_bounce(stated_pose(scene));
  const double peak = *std::max_element(light.values.begin(), light.values.end());
  for (int k = 3; k < light.bins; ++k) {
    EXPECT_NEAR(light.zone(1)[k], light.zone(0)[k - 3], 1e-9 * peak);
  }
}

}  // namespace
}  // namespace blindcorner
