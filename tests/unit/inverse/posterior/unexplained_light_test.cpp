// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/unexplained_light.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <random>

#include "blindcorner/inverse/fit.h"
#include "blindcorner/simulation/drawn_objects.h"
#include "bundled.h"

namespace blindcorner {
namespace {

/// Scores with this covariance, as many directions as it has.
Eigen::MatrixXd correlated(int count) {
  Eigen::MatrixXd covariance(count, count);
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < count; ++j) {
      covariance(i, j) = (1 + i) * (1 + j) * std::exp(-0.1 * (i - j) * (i - j));
    }
  }
  return covariance;
}

// Of 20,000 draws from the covariance, so many are below a probability as it says: Satterthwaite's
// chi-square is some per cent off in the tail, beside which three standard deviations of the
// binomial share (0.0007 of 0.01) are small.
TEST(ScoreTest, ProbabilitiesAreThoseOfCorrelatedScores) {
  const Eigen::MatrixXd covariance = correlated(12);
  const Eigen::MatrixXd root = covariance.llt().matrixL();
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  constexpr int kDraws = 20'000;
  int tenth = 0, hundredth = 0;
  for (int i = 0; i < kDraws; ++i) {
    const Eigen::VectorXd score =
        root * Eigen::VectorXd::NullaryExpr(12, [&] { return normal(random); });
    const ScoreTest test = score_test(score, covariance, Eigen::VectorXd::Ones(12));
    tenth += test.probability < 0.1 ? 1 : 0;
    hundredth += test.probability < 0.01 ? 1 : 0;
  }
  EXPECT_NEAR(tenth, 0.1 * kDraws, 0.01 * kDraws);
  EXPECT_NEAR(hundredth, 0.01 * kDraws, 0.004 * kDraws);
}

// Independent scores are a chi-square of their number; of equal ones there is one.
TEST(ScoreTest, FreedomCountsIndependentScores) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(5);
  EXPECT_NEAR(score_test(ones, Eigen::MatrixXd::Identity(5, 5), ones).freedom, 5, 1e-12);
  EXPECT_NEAR(score_test(ones, Eigen::MatrixXd::Ones(5, 5), ones).freedom, 1, 1e-12);
  // 1.96 standard deviations of one score.
  EXPECT_NEAR(score_test(1.959964 * ones, Eigen::MatrixXd::Ones(5, 5), ones).probability, 0.05,
              1e-6);
  EXPECT_EQ(score_test(Eigen::VectorXd(0), Eigen::MatrixXd(0, 0), Eigen::VectorXd(0)).probability,
            1);
}

/// How many fits of captures, drawn as the scene says but for `wrong`, are flagged.
int flagged(const std::string& wrong, int captures) {
  const Scene scene = bundled_scene("denali_like");
  FitOptions options;
  options.importance_samples = 0;
  options.empty_captures = 0;
  const Fitter fitter(scene, options);
  DrawOptions draw;
  draw.objects = captures;
  draw.sampling = 0.4;
  draw.wrong = wrong;
  int count = 0;
  std::uint64_t seed = 0;
  for (const DrawnObject& object : draw_objects(scene, draw)) {
    const FitResult result =
        fitter.fit(capture_of(scene, object, own_exposure(scene), seed += 1'000'003));
    count += static_cast<int>(std::ranges::count(result.flags, "unexplained_light"));
  }
  return count;
}

// A right scene is flagged in 1 of 200: more than 4 of 60 come once in sixty thousand such tests.
// What a larger plate or a second one puts elsewhere is a few standard deviations, which the
// deviance over all bins does not show: about half of the captures are flagged;
// fewer than 4 of 30, where a half is due, come once in two hundred thousand.
TEST(UnexplainedLight, FlagsWhatTheDevianceDoesNotShow) {
  EXPECT_LE(flagged("", 60), 4);
  EXPECT_GE(flagged("another size", 30), 4);
  EXPECT_GE(flagged("second object", 30), 4);
}

}  // namespace
}  // namespace blindcorner
