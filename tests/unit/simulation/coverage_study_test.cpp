// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/coverage_study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>

#include "blindcorner/forward/error.h"
#include "bundled.h"
#include "unit/error_message.h"
#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using ::testing::HasSubstr;

/// With this confidence an honest method's claims hold all together: a test that fails once in ten
/// thousand seeds.
constexpr double kSure = 0.9999;
constexpr int kTrials = 1000;

Scene two_unknowns() {
  Scene scene = testing_scenes::one_narrow_zone();
  scene.unknowns = {{Component::x, -10, 10, {}}, {Component::y, -10, 10, {}}};
  return scene;
}

PoseMode mode_at(double weight, double x, const Eigen::Matrix2d& covariance) {
  PoseMode mode;
  mode.weight = weight;
  mode.pose = Eigen::Vector2d(x, 0.5);
  mode.covariance = covariance;
  return mode;
}

/// A method that claims modes whose covariance is `factor` times that of its errors, and weights
/// other than those with which the truth is drawn.
std::vector<ClaimTrial> fake_trials(const std::vector<double>& weights,
                                    const std::vector<double>& claimed, double factor) {
  const Scene scene = two_unknowns();
  Eigen::Matrix2d covariance;
  covariance << 0.04, 0.01, 0.01, 0.02;
  const Eigen::Matrix2d root = covariance.llt().matrixL();
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::discrete_distribution<std::size_t> pick(weights.begin(), weights.end());
  std::vector<ClaimTrial> trials;
  for (int i = 0; i < kTrials; ++i) {
    FitResult result;
    PoseMixture& posterior = result.posterior;
    posterior.mean = Eigen::Vector2d::Zero();
    Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
    for (std::size_t m = 0; m < weights.size(); ++m) {
      posterior.modes.push_back(
          mode_at(claimed[m], 4.0 * static_cast<double>(m), factor * covariance));
      posterior.mean += claimed[m] * posterior.modes[m].pose;
    }
    for (const PoseMode& mode : posterior.modes) {
      const Eigen::Vector2d d = mode.pose - posterior.mean;
      second += mode.weight * (mode.covariance + d * d.transpose());
    }
    posterior.covariance = second;
    const PoseVector truth =
        posterior.modes[pick(random)].pose + root * Eigen::Vector2d(normal(random), normal(random));
    trials.push_back(judge_fit(scene, result, truth, static_cast<std::uint64_t>(i)));
  }
  return trials;
}

std::vector<ClaimTest> judged(const std::vector<ClaimTrial>& trials) {
  std::vector<ClaimTest> claims = claims_of(trials, 2);
  std::vector<ClaimTest*> all;
  for (ClaimTest& c : claims) all.push_back(&c);
  judge_claims(all, kSure);
  return claims;
}

bool holds(const std::vector<ClaimTest>& claims, const std::string& part) {
  bool all = true;
  for (const ClaimTest& c : claims) {
    if (c.what.find(part) != std::string::npos) all = all && c.holds;
  }
  return all;
}

TEST(CoverageStudy, KeepsLevelsOfLightThatAreFinishedWhenItIsInterrupted) {
  StudyScene<CoverageLevel> study;
  int begun = 0;
  add_levels(std::vector<ClaimLevel>(4), study, [&](CoverageLevel& /*level*/) {
    if (++begun == 3) throw StudyInterrupted{};
  });
  EXPECT_EQ(begun, 3);
  EXPECT_EQ(study.levels.size(), 2u);
}

TEST(CoverageStudy, AnHonestMethodsClaimsHold) {
  for (const ClaimTest& c : judged(fake_trials({1}, {1}, 1))) EXPECT_TRUE(c.holds) << c.what;
}

TEST(CoverageStudy, FindsRegionsThatAreTooSmallOrTooLarge) {
  for (const double factor : {0.5, 2.0}) {
    const std::vector<ClaimTest> claims = judged(fake_trials({1}, {1}, factor));
    EXPECT_FALSE(holds(claims, "region")) << factor;
    EXPECT_FALSE(holds(claims, "normalised")) << factor;
    // The mean of the squares themselves: one over the factor.
    EXPECT_NEAR(claims[3].found, 1 / factor, 5 / factor / std::sqrt(kTrials));
  }
}

TEST(CoverageStudy, WeightsOfModesMustBeTheSharesOfRightOnes) {
  EXPECT_TRUE(holds(judged(fake_trials({0.7, 0.3}, {0.7, 0.3}, 1)), "weight"));
  EXPECT_FALSE(holds(judged(fake_trials({0.7, 0.3}, {0.85, 0.15}, 1)), "weight"));
}

TEST(CoverageStudy, AModeFarFromTheTruthIsNotRight) {
  FitResult result;
  result.posterior.modes = {mode_at(1, 0, 0.01 * Eigen::Matrix2d::Identity())};
  result.posterior.mean = result.posterior.modes[0].pose;
  result.posterior.covariance = result.posterior.modes[0].covariance;
  const ClaimTrial far = judge_fit(two_unknowns(), result, Eigen::Vector2d(1, 0.5), 1);
  EXPECT_FALSE(far.modes[0].right);
  EXPECT_NEAR(far.normalised_square, 100, 1e-9);
  EXPECT_NEAR(far.distance, 1, 1e-12);
  EXPECT_NEAR(far.claimed, std::sqrt(0.02), 1e-12);
  EXPECT_TRUE(judge_fit(two_unknowns(), result, Eigen::Vector2d(0.1, 0.5), 1).modes[0].right);
}

ClaimTrial trial_of(double level, double claimed, std::vector<std::string> flags) {
  ClaimTrial trial;
  trial.level = level;
  trial.claimed = claimed;
  trial.distance = claimed;
  trial.flags = std::move(flags);
  return trial;
}

// Ten captures outside of their regions: warned of, the row holds; not warned of, it does not.
TEST(CoverageStudy, WrongAssumptionsMustGrowOrWarn) {
  const std::vector<ClaimTrial> right(10, trial_of(0.4, 0.1, {}));
  const std::vector<ClaimTrial> warned(10, trial_of(1, 0.3, {"model_misfit"}));
  const std::vector<ClaimTrial> silent(10, trial_of(1, 0.1, {"sampled"}));
  const WrongFigures good = wrong_figures({"a", "", ""}, warned, right);
  EXPECT_TRUE(good.holds);
  EXPECT_EQ(good.unwarned, 0);
  EXPECT_EQ(good.held[2], 0);
  EXPECT_NEAR(good.claimed_growth, 3, 1e-12);
  EXPECT_EQ(good.warnings.misfit, 1);
  const WrongFigures bad = wrong_figures({"b", "", ""}, silent, right);
  EXPECT_FALSE(bad.holds);
  EXPECT_EQ(bad.unwarned, 10);
  EXPECT_EQ(bad.warnings.warned, 0);
}

// One in a hundred by chance, a half where the shift is the threshold itself.
TEST(CoverageStudy, TheBestTestSeesAShiftOfANormalVariable) {
  EXPECT_NEAR(power_of_best_test(0), 0.01, 1e-12);
  EXPECT_NEAR(power_of_best_test(2.3263479), 0.5, 1e-6);
  std::vector<ClaimTrial> outside(10, trial_of(1, 0.1, {}));
  for (int i = 0; i < 5; ++i) outside[static_cast<std::size_t>(i)].unexplained_distance = 20;
  const WrongFigures figures = wrong_figures({"a", "", ""}, outside, outside);
  EXPECT_NEAR(figures.best_warned, 0.5 * (1 + 0.01), 1e-9);
  EXPECT_NEAR(figures.best_unwarned, 0.5 * 0.99, 1e-9);
}

// A right scene explains its own expected counts but for the models' difference, which fits keep
// below a part of the photon noise. Nothing explains those of a relay that stands otherwise: this
// is the wrong assumption of which every capture is flagged.
TEST(CoverageStudy, OnlyAWrongSceneLeavesExpectedCountsUnexplained) {
  const Scene scene = bundled_scene("denali_like");
  FitOptions options;
  options.importance_samples = options.empty_captures = 0;
  const Fitter fitter(scene, options);
  DrawOptions draw;
  draw.objects = 3;
  draw.sampling = 0.4;
  for (const DrawnObject& object : draw_objects(scene, draw)) {
    EXPECT_LT(unexplained_distance(fitter, object, own_exposure(scene)), 1);
  }
  draw.wrong = "relay tilted by 2 degrees";
  for (const DrawnObject& object : draw_objects(scene, draw)) {
    EXPECT_GT(unexplained_distance(fitter, object, own_exposure(scene)), 5);
  }
}

TEST(CoverageStudy, RunsAsToldAndWithEachWrongAssumption) {
  const Scene scene = bundled_scene("denali_like");
  CoverageOptions options;
  options.captures = 3;
  options.wrong_captures = 2;
  options.light = TrueLight::sensor;
  options.photons = {300};
  options.fit.importance_samples = 0;
  options.fit.empty_captures = 0;
  options.fit.model_tolerance = 0.2;
  std::vector<CoverageScene> study{study_coverage(scene, options)};
  ASSERT_EQ(study.front().levels.size(), 1U);
  const CoverageLevel& level = study.front().levels.front();
  ASSERT_EQ(level.trials.size(), 3U);
  for (const ClaimTrial& t : level.trials) EXPECT_EQ(t.error, "");
  ASSERT_EQ(level.wrong.size(), wrong_assumptions(scene).size());
  std::vector<std::string> names;
  for (const WrongFigures& w : level.wrong) {
    names.push_back(w.assumption.name);
    EXPECT_EQ(w.captures, 2);
    EXPECT_EQ(w.failures, 0);
  }
  EXPECT_THAT(names,
              ::testing::UnorderedElementsAre("another albedo", "another size", "another material",
                                              "time zero off by half a bin",
                                              "relay tilted by 2 degrees", "second object"));
  EXPECT_EQ(level.failures, 0);
  judge_study(study);
  EXPECT_GT(level.claims.front().high, 0);
}

// Light goes with the size squared times the brightness: only where it arrives tells the two apart,
// weakly, so that the little that a model is off moves both far. The plate stays clear of the
// partition at every size. Of 60 honest captures fewer than 48 lie in their 95 % regions, or the
// mean of three squares exceeds 1.46, once in ten thousand times each.
TEST(CoverageStudy, SizeAndBrightnessFreeAreAsSureAsTheySay) {
  Scene scene = bundled_scene("tmf8828_wall");
  scene.unknowns = {{Component::x, 0.15, 0.38, {}},
                    {Component::y, 0.45, 0.7, {}},
                    {Component::size, 0.5, 1.5, {}}};
  CoverageOptions options;
  options.captures = 60;
  options.wrong_captures = 0;
  options.photons = {10000};
  options.sampling = 0.5;
  options.fit.empty_captures = 0;
  const CoverageScene study = study_coverage(scene, options);
  const std::vector<ClaimTrial>& trials = study.levels.front().trials;
  ASSERT_EQ(trials.size(), 60U);
  int held = 0;
  double squares = 0;
  for (const ClaimTrial& t : trials) {
    held += t.error.empty() && t.level <= 0.95 ? 1 : 0;
    squares += t.normalised_square / (3 * 60.0);
  }
  std::printf("in the region %d of 60, mean square %.2f\n", held, squares);
  EXPECT_GE(held, 48);
  EXPECT_LT(squares, 1.46);
}

// Near the relay the renderer's own sampling shows in bright captures: it must not be taken for the
// fit's error. A denser truth errs less, and brighter light shows more of it.
TEST(CoverageStudy, SaysWhatTheTruthsSamplingAdds) {
  const Scene scene = bundled_scene("tmf8828_wall");
  const auto added = [&](double sampling, double photons, TrueLight light = TrueLight::reference) {
    CoverageOptions options;
    options.captures = 4;
    options.wrong_captures = 0;
    options.photons = {photons};
    options.sampling = sampling;
    options.light = light;
    options.fit.importance_samples = options.fit.empty_captures = 0;
    return study_coverage(scene, options).levels.front().truth_error;
  };
  const auto coarse = added(0.3, 1e5), dense = added(0.6, 1e5), dim = added(0.3, 1e3);
  ASSERT_TRUE(coarse && dense && dim);
  EXPECT_LT(*dense, 0.5 * *coarse);
  EXPECT_LT(*dim, 0.1 * *coarse);
  EXPECT_FALSE(added(0.15, 1e3)) << "half of it is less than the renderer takes";
  EXPECT_FALSE(added(1, 1e3, TrueLight::sensor));
}

TEST(DrawnObjects, AreTheSameWhateverTheSceneIsWrongAbout) {
  const Scene scene = bundled_scene("denali_like");
  DrawOptions options;
  options.objects = 2;
  options.light = TrueLight::sensor;
  const auto right = draw_objects(scene, options);
  options.wrong = "another albedo";
  const auto dim = draw_objects(scene, options);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(right[i].pose, dim[i].pose);
    EXPECT_EQ(right[i].amplitude, dim[i].amplitude);
    // Half the albedo, half the light.
    EXPECT_NEAR(
        total_counts(scene, dim[i].three_bounce) / total_counts(scene, right[i].three_bounce), 0.5,
        1e-9);
  }
  options.wrong = "another colour";
  EXPECT_THAT(message_of([&] { draw_objects(scene, options); }),
              HasSubstr("accepted: another albedo"));
}

}  // namespace
}  // namespace blindcorner
