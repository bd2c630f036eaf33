// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/solver_sweep.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "bundled.h"
#include "unit/error_message.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

SweepTrial answered(double distance, double seconds) {
  SweepTrial trial;
  trial.distance = distance;
  trial.cpu = trial.wall = seconds;
  return trial;
}

TEST(SolverSettings, StartWithTheDefaultAndHaveNamesOfTheirOwn) {
  const std::vector<SolverSetting> settings = solver_settings();
  EXPECT_EQ(settings.front().name, "default");
  EXPECT_EQ(settings.front().fit.max_starts, FitOptions{}.max_starts);
  std::set<std::string> names;
  for (const SolverSetting& s : settings) {
    names.insert(s.name);
    EXPECT_NO_THROW(s.fit.validate()) << s.name;
  }
  EXPECT_EQ(names.size(), settings.size());
}

// Errors of 1.1 times the bound in the right mode; what is wrong, or has a bound above a quarter of
// the pulse, does not count.
TEST(SweepFigures, EfficiencyIsErrorOverBoundWhereItCounts) {
  SweepCell cell;
  std::vector<double> bound;
  for (int i = 0; i < 8; ++i) {
    bound.push_back(0.01 * (i + 1));
    SweepTrial trial = answered(0.5, 0.1 * (i + 1));
    trial.level = i < 7 ? 0.5 : 0.99;
    trial.right = i != 0;
    trial.of_heaviest = (i == 0 ? 50 : 1.1) * bound.back();
    cell.trials.push_back(trial);
  }
  const double pulse = 4 * 0.055;
  const SweepFigures figures = figures_of(cell, bound, pulse, 1);
  EXPECT_EQ(figures.efficiency_captures, 4);  // 2, 3, 4 and 5 cm
  EXPECT_NEAR(figures.efficiency, 1.1, 1e-12);
  EXPECT_EQ(figures.right, 7);
  EXPECT_EQ(figures.held, 7);
  EXPECT_EQ(figures.claims, 8);
  EXPECT_NEAR(figures.median, 0.5, 1e-12);
  EXPECT_NEAR(figures.following_cpu, 0.45, 1e-12);
}

TEST(SweepFigures, FailuresAreNoAnswers) {
  SweepCell cell;
  cell.trials = {answered(1, 1), {"no light"}, answered(3, 3)};
  const SweepFigures figures = figures_of(cell, {1, 1, 1}, 1, 1);
  EXPECT_EQ(figures.answers, 2);
  EXPECT_EQ(figures.failures, 1);
  EXPECT_NEAR(figures.median, 2, 1e-12);
  EXPECT_NEAR(figures.rms, std::sqrt(5), 1e-12);
  EXPECT_TRUE(std::isnan(figures.efficiency));
}

/// A scene of 40 objects at one level: the default, and methods whose errors are the default's
/// times a factor and noise, in a share of its time.
struct FakeMethod {
  std::string name;
  double error, noise, time;
};
SweepScene fake_scene(const std::vector<FakeMethod>& others) {
  SweepScene scene;
  scene.name = "fake";
  scene.levels.resize(1);
  SweepLevel& level = scene.levels.front();
  level.bound.assign(40, 0.01);
  std::vector<FakeMethod> all{{"default", 1, 0, 1}};
  all.insert(all.end(), others.begin(), others.end());
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  std::vector<double> errors;
  for (int i = 0; i < 40; ++i) errors.push_back(0.02 * std::exp(normal(random)));
  for (const FakeMethod& method : all) {
    scene.methods.push_back({method.name, "", true, 1, {}});
    SweepCell cell;
    cell.first_cpu = 5 * method.time;
    for (const double error : errors) {
      cell.trials.push_back(
          answered(error * method.error * std::exp(method.noise * normal(random)), method.time));
    }
    level.figures.push_back(figures_of(cell, level.bound, 1, 1));
    level.cells.push_back(std::move(cell));
  }
  return scene;
}

TEST(SweepVerdict, TellsWhatBeatsTheDefaultFromWhatMayOrMayNot) {
  const SweepVerdict verdict = verdict_of({fake_scene({{"cheaper and better", 0.7, 0.1, 0.5},
                                                       {"cheaper, level", 1.0, 0.3, 0.5},
                                                       {"cheaper and worse", 1.5, 0.1, 0.2},
                                                       {"dearer and better", 0.5, 0.1, 3}})});
  ASSERT_EQ(verdict.ratios.size(), 5U);
  EXPECT_THAT(verdict.better, ElementsAre(1));
  EXPECT_THAT(verdict.level, ElementsAre(2));
  EXPECT_NEAR(verdict.ratios[3].time, 0.2, 1e-9);
  EXPECT_NEAR(verdict.ratios[3].first_time, 0.2, 1e-9);
  // The mean of 40 logarithms with a spread of 0.1: to 0.016, three times that is 0.047.
  EXPECT_NEAR(verdict.ratios[3].error, 1.5, 1.5 * 0.05);
  EXPECT_LT(verdict.ratios[3].error_low, verdict.ratios[3].error);
  EXPECT_THAT(verdict.headline(), HasSubstr("not on the front"));
}

TEST(SweepVerdict, ADefaultThatNothingBeatsIsOnTheFront) {
  const SweepVerdict verdict =
      verdict_of({fake_scene({{"cheaper and worse", 1.5, 0.1, 0.2}, {"dearer", 0.9, 0.1, 3}})});
  EXPECT_THAT(verdict.better, IsEmpty());
  EXPECT_THAT(verdict.level, IsEmpty());
  EXPECT_THAT(verdict.front, ElementsAre(1, 0, 2));
  EXPECT_EQ(verdict.on_front, 1);
  EXPECT_THAT(verdict.headline(), HasSubstr("The default is on the front"));
}

/// A method that answers the truth and a shift.
SweptMethod shifted(const std::string& name, double shift) {
  return {name, "", false, 1, [shift]() -> SweepAnswerer {
            return [shift](const Capture& capture) {
              PoseVector pose(1);
              pose << capture.truth.at("x_m") + shift;
              PoseMixture posterior;
              PoseMode mode;
              mode.weight = 1;
              mode.pose = mode.optimum = pose;
              mode.covariance = Eigen::MatrixXd::Constant(1, 1, 1e-6);
              posterior.modes = {mode};
              posterior.mean = pose;
              posterior.covariance = mode.covariance;
              return SweepAnswer{pose, posterior};
            };
          }};
}

// The light of a scene with one unknown: four times the photons halve the bound.
TEST(SolverSweep, AsksAllMethodsTheSameCapturesBesideTheBound) {
  Scene scene = testing_scenes::one_narrow_zone();
  scene.linear.direct = LinearMode::fixed;
  scene.linear.fixed_direct = 0;
  SweepOptions options;
  options.captures = 3;
  options.photons = {2500, 10000};
  const std::vector<SweptMethod> methods{
      shifted("near", 1e-3), shifted("far", 1e-2), {"broken", "", false, 1, []() -> SweepAnswerer {
                                                      throw std::runtime_error("cannot");
                                                    }}};
  int asked = 0;
  const SweepScene sweep = sweep_scene(scene, methods, options, [&] { ++asked; });
  EXPECT_EQ(asked, 18);
  ASSERT_EQ(sweep.levels.size(), 2U);
  for (const SweepLevel& level : sweep.levels) {
    EXPECT_NEAR(level.figures[0].median, 1e-3, 1e-9);
    EXPECT_EQ(level.figures[0].right, 3);
    EXPECT_EQ(level.figures[1].right, 0);
    EXPECT_EQ(level.figures[2].failures, 3);
    EXPECT_EQ(level.cells[2].trials[1].error, "cannot");
    EXPECT_GT(level.bound_rms, 0);
  }
  // The prior of +-1 cm is part of the bound, so that it is less than a half.
  EXPECT_LT(sweep.levels[1].bound_rms, sweep.levels[0].bound_rms);
  EXPECT_THAT(message_of([&] {
                SweepOptions none;
                none.photons = {};
                sweep_scene(scene, methods, none);
              }),
              HasSubstr("photons"));
}

// Bright captures show the sampling of their truth: whoever asks for a denser one must get it.
TEST(SolverSweep, RendersTheTruthWithTheSamplingAskedFor) {
  const Scene scene = bundled_scene("denali_like");
  const auto counts_with = [&](double sampling) {
    std::vector<double> counts;
    const SweptMethod listener{"listener", "", false, 1, [&counts]() -> SweepAnswerer {
                                 return [&counts](const Capture& capture) {
                                   counts = capture.counts.values;
                                   return SweepAnswer{PoseVector::Zero(2), {}};
                                 };
                               }};
    SweepOptions options;
    options.captures = 2;
    options.photons = {1e9};
    options.sampling = sampling;
    sweep_scene(scene, {listener}, options);
    return counts;
  };
  const std::vector<double> coarse = counts_with(0.1);
  ASSERT_FALSE(coarse.empty());
  EXPECT_EQ(coarse, counts_with(0.1));
  EXPECT_NE(coarse, counts_with(0.3));
}

}  // namespace
}  // namespace blindcorner
