// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/detection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <thread>

#include "bundled.h"
#include "inverse/search/scoring.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

constexpr int kCaptures = 32;

class Detection : public testing::Test {
 protected:
  Detection() : scene_(bundled_scene("denali_like")) {
    for (int i = 0; i < 8; ++i) {
      PoseVector pose = testing_scenes::stated_pose(scene_);
      captures_.push_back(
          testing_scenes::reference_capture(scene_, pose, 12, static_cast<std::uint64_t>(i)));
      // Levels of light, exposures and background that lie within one step of each other.
      captures_.back().exposures *= std::exp2(0.05 * i);
    }
    compiled_ = compile(scene_, {sensor_placement(scene_)}, {}, {});
  }

  double probability(FalseAlarmCalibration& calibration, const Capture& capture,
                     const CompiledScene& compiled) const {
    const Observation observation = observe(scene_, {&capture, 1}, compiled.gates);
    const PoseObjective objective(compiled, observation);
    LinearSolution empty;
    objective.evaluate_empty(empty);
    return calibration.probability(objective, empty, kCaptures, 1);
  }

  std::vector<double> probabilities(const std::vector<Capture>& captures) const {
    FalseAlarmCalibration calibration;
    std::vector<double> result;
    for (const Capture& c : captures) result.push_back(probability(calibration, c, *compiled_));
    return result;
  }

  Scene scene_;
  std::vector<Capture> captures_;
  std::unique_ptr<CompiledScene> compiled_;
};

TEST_F(Detection, OrderOfCapturesDoesNotMatter) {
  const std::vector<double> forward = probabilities(captures_);
  std::vector<double> backward = probabilities({captures_.rbegin(), captures_.rend()});
  std::reverse(backward.begin(), backward.end());
  EXPECT_EQ(forward, backward);
  for (std::size_t i = 0; i < captures_.size(); ++i) {
    EXPECT_EQ(probabilities({captures_[i]}).front(), forward[i]) << "alone";
  }
}

// Counts may be averages over any number of exposures, in any unit of the gain: what is detected is
// the same. (With variances held above 1e-12 of a count squared, captures in W/m^2 were scored as
// if each bin had the same noise, and objects of 10,000 photons passed for empty scenes.)
TEST_F(Detection, UnitOfCountsDoesNotMatter) {
  constexpr double kUnit = 1e-8;
  Scene scene = scene_;
  for (Zone& zone : scene.sensor.zones) zone.gain *= kUnit;
  const auto compiled = compile(scene, {sensor_placement(scene)}, {}, {});
  const auto largest_score = [](const Scene& of, const Capture& capture,
                                const CompiledScene& known) {
    const Observation observation = observe(of, {&capture, 1}, known.gates);
    const PoseObjective objective(known, observation);
    LinearSolution empty;
    objective.evaluate_empty(empty);
    const MatchedFilter filter(objective, empty, MatchedFilter::Weights::expected,
                               MatchedFilter::Priors::ignored);
    return static_cast<double>(filter.scores().maxCoeff());
  };
  for (const Capture& capture : captures_) {
    Capture scaled = capture;
    for (double& count : scaled.counts.values) count *= kUnit;
    scaled.exposures /= kUnit;
    const double score = largest_score(scene_, capture, *compiled_);
    EXPECT_NEAR(largest_score(scene, scaled, *compiled), score, 1e-3 * score);
  }
}

TEST_F(Detection, ThreadsDoNotMatter) {
  const std::vector<double> one = probabilities(captures_);
  FalseAlarmCalibration shared;
  std::vector<double> two(captures_.size());
  // Each takes every other capture, the last ones first.
  const auto every_other = [&](std::size_t from) {
    for (std::size_t i = captures_.size(); i-- > 0;) {
      if (i % 2 == from) two[i] = probability(shared, captures_[i], *compiled_);
    }
  };
  std::array<std::thread, 2> threads{std::thread(every_other, 0), std::thread(every_other, 1)};
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(one, two);
}

// What the zones' exposures are is part of the level.
TEST_F(Detection, ZonesWithoutDataDoNotDecideForOthers) {
  Capture partial = captures_.front();
  partial.zone_exposures.emplace(static_cast<std::size_t>(scene_.sensor.zone_count()),
                                 partial.exposures);
  for (std::size_t z = 1; z < partial.zone_exposures->size(); ++z) (*partial.zone_exposures)[z] = 0;
  const std::vector<double> first = probabilities({captures_.front(), partial});
  const std::vector<double> second = probabilities({partial, captures_.front()});
  EXPECT_EQ(first[0], second[1]);
  EXPECT_EQ(first[1], second[0]);
}

// A sensor that moves judges all its captures by the scene's own placement.
TEST_F(Detection, PosesShareTheScenesDistributions) {
  SensorPlacement moved = sensor_placement(scene_);
  moved.T_world_sensor.translation().y() += 0.05;
  const auto there = compile(scene_, {moved}, {}, {});
  FalseAlarmCalibration here_first(compiled_.get());
  FalseAlarmCalibration there_first(compiled_.get());
  const Capture& capture = captures_.front();
  const double here = probability(here_first, capture, *compiled_);
  const double a = probability(here_first, capture, *there);
  const double b = probability(there_first, capture, *there);
  EXPECT_EQ(a, b);
  EXPECT_EQ(probability(there_first, capture, *compiled_), here);
}

// Empty captures at any level of light: the share that reaches a probability is that probability.
// 400 captures, judged by a law from 512: standard deviations of the share at 0.1 are 0.015 and,
// for what 512 captures leave of the location, 0.006; the rest is for the Gumbel law's shape.
TEST_F(Detection, ProbabilityIsTheShareOfEmptyCaptures) {
  const auto model = make_reference_renderer(scene_, sensor_placement(scene_));
  const Sensor& sensor = scene_.sensor;
  const HistogramCube nothing(sensor.rows, sensor.columns, sensor.bins);
  for (const double ambient : {0.05, 1.0, 40.0}) {
    const HistogramCube expected =
        expected_counts(scene_, nothing, model->static_background(), {0.0, ambient, 1.0});
    FalseAlarmCalibration calibration;
    int alarms = 0;
    for (std::uint64_t seed = 1; seed <= 400; ++seed) {
      Capture capture;
      capture.counts = draw_counts(scene_, expected, 1.0, seed);
      const Observation observation = observe(scene_, {&capture, 1}, compiled_->gates);
      const PoseObjective objective(*compiled_, observation);
      LinearSolution empty;
      objective.evaluate_empty(empty);
      if (calibration.probability(objective, empty, 512, 1) < 0.1) ++alarms;
    }
    EXPECT_NEAR(alarms / 400.0, 0.1, 0.07) << ambient;
  }
}

}  // namespace
}  // namespace blindcorner
