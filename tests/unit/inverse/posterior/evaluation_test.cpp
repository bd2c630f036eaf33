// SPDX-License-Identifier: Apache-2.0
/// Figures of merit against closed forms.
#include "blindcorner/inverse/posterior/evaluation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

EstimateError estimate(double x, double y, double sx, double sy, const std::string& group = "") {
  return {Eigen::Vector2d(x, y), Eigen::Vector2d(sx * sx, sy * sy).asDiagonal(), group};
}

TEST(Evaluation, MatchesClosedForms) {
  const Evaluation e =
      evaluate_errors({estimate(3, 0, 2, 1), estimate(-3, 4, 1, 2.5)}, {"x_m", "y_m"});
  EXPECT_DOUBLE_EQ(e.figure("rmse_x_m").value, 3);
  EXPECT_DOUBLE_EQ(e.figure("rmse_y_m").value, std::sqrt(8.0));
  EXPECT_DOUBLE_EQ(e.figure("rmse_m").value, std::sqrt((9.0 + 9.0 + 16.0) / 4));
  EXPECT_DOUBLE_EQ(e.figure("median_distance_m").value, 4);  // lengths 3 and 5
  EXPECT_NEAR(e.figure("p90_distance_m").value, 3 + 0.9 * 2, 1e-12);
  // In claimed sigmas: 1.5, 0; 3, 1.6.
  EXPECT_DOUBLE_EQ(e.figure("coverage_1sigma").value, 0.25);
  EXPECT_DOUBLE_EQ(e.figure("coverage_2sigma").value, 0.75);
  EXPECT_NEAR(e.figure("normalised_error").value, (2.25 + 0 + 9 + 2.56) / 4, 1e-12);
}

TEST(Evaluation, KeepsAnglesApartFromPositions) {
  const Evaluation e =
      evaluate_errors({estimate(0.3, 2, 1, 1), estimate(0.1, -1, 1, 1)}, {"x_m", "yaw_rad"});
  EXPECT_DOUBLE_EQ(e.figure("median_distance_m").value, 0.2);
  EXPECT_DOUBLE_EQ(e.figure("rmse_m").value, e.figure("rmse_x_m").value);
  EXPECT_DOUBLE_EQ(e.figure("median_yaw_rad").value, 1.5);
  EXPECT_DOUBLE_EQ(e.figure("p90_yaw_rad").value, 1.9);
  const Evaluation turns = evaluate_errors({estimate(1, 2, 1, 1)}, {"yaw_rad", "size"});
  EXPECT_THROW(turns.figure("rmse_m"), Error) << "no position";
}

TEST(Evaluation, CorrelatedErrorsAreNormalisedTogether) {
  Eigen::Matrix2d covariance;
  covariance << 1, 0.9, 0.9, 1;
  const Evaluation e = evaluate_errors({{Eigen::Vector2d(1, 1), covariance, ""}}, {"x", "y"});
  EXPECT_NEAR(e.figure("normalised_error").value, 1 / 1.9, 1e-12);  // e' C^-1 e / 2
}

// Honest Gaussian errors; the interval of the bootstrap is the binomial one.
TEST(Evaluation, HonestErrorsAreFoundHonest) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<EstimateError> errors;
  for (int i = 0; i < 4000; ++i) {
    errors.push_back(estimate(0.5 * normal(random), 2 * normal(random), 0.5, 2));
  }
  EvaluationOptions options;
  options.resamples = 400;
  const Evaluation e = evaluate_errors(errors, {"x", "y"}, options);
  EXPECT_NEAR(e.figure("coverage_1sigma").value, 0.6827, 4 * std::sqrt(0.6827 * 0.3173 / 8000));
  EXPECT_NEAR(e.figure("coverage_2sigma").value, 0.9545, 4 * std::sqrt(0.9545 * 0.0455 / 8000));
  EXPECT_NEAR(e.figure("normalised_error").value, 1, 4 * std::sqrt(2.0 / 8000));
  const Figure& f = e.figure("coverage_1sigma");
  const double width = 2 * 1.96 * std::sqrt(0.6827 * 0.3173 / 8000);
  EXPECT_NEAR((f.high - f.low) / width, 1, 0.25);
  EXPECT_LT(f.low, f.value);
  EXPECT_GT(f.high, f.value);
}

// Five copies of each estimate tell no more than one.
TEST(Evaluation, RepeatedPositionsAreDrawnTogether) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  std::vector<EstimateError> once, copies;
  for (int i = 0; i < 200; ++i) {
    once.push_back(estimate(normal(random), normal(random), 1, 1, std::to_string(i)));
    for (int k = 0; k < 5; ++k) copies.push_back(once.back());
  }
  const Figure a = evaluate_errors(once, {"x_m", "y_m"}).figure("rmse_m");
  const Evaluation together = evaluate_errors(copies, {"x_m", "y_m"});
  const Figure b = together.figure("rmse_m");
  EXPECT_EQ(together.groups, 200);
  EXPECT_NEAR((b.high - b.low) / (a.high - a.low), 1, 0.1);
}

TEST(Evaluation, RefusesWhatCannotBeEvaluated) {
  EXPECT_THROW(evaluate_errors({}, {"x"}), Error);
  EXPECT_THROW(evaluate_errors({estimate(1, 1, 0, 1)}, {"x", "y"}), Error);
  EXPECT_THROW(
      evaluate_errors({estimate(std::numeric_limits<double>::quiet_NaN(), 1, 1, 1)}, {"x", "y"}),
      Error);
  EvaluationOptions options;
  options.interval = 1;
  EXPECT_THROW(options.validate(), Error);
}

}  // namespace
}  // namespace blindcorner
