// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/sensor/impulse_response.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

constexpr double kPicosecond = 1e-12;

/// Pulse of the TMF8828: see the preset.
ExponentialTailResponse tmf8828() {
  return {243.2 * kPicosecond / kGaussianFwhm,
          {{0.197, 524.6 * kPicosecond}, {0.104, 100.8 * kPicosecond}}};
}

struct ResponseCase {
  std::string name;
  ResponseShape shape;
};
void PrintTo(const ResponseCase& c, std::ostream* out) { *out << c.name; }

std::vector<ResponseCase> response_cases() {
  return {{"gaussian", GaussianResponse{103e-12}},
          {"box", BoxGaussianResponse{2891e-12, 263e-12}},
          {"narrow_box", BoxGaussianResponse{100e-12, 263e-12}},
          {"tails", tmf8828()},
          {"all_tail", ExponentialTailResponse{50e-12, {{1.0, 400e-12}}}},
          {"table",
           TableResponse{{-1e-9, -0.4e-9, -0.1e-9, 0.3e-9, 1.1e-9, 3e-9}, {0, 1, 7, 5, 0.6, 0}}}};
}

class EveryResponse : public testing::TestWithParam<ResponseCase> {
 protected:
  ImpulseResponse response_{GetParam().shape};
  /// Times that hold all but 1e-10 of the energy.
  std::pair<double, double> all(double blur = 0) const { return response_.support(1e-10, blur); }
};

TEST_P(EveryResponse, IntegratesToOneAndNeverFalls) {
  const auto [early, late] = all();
  EXPECT_NEAR(response_.cumulative(10 * early), 0.0, 1e-9);
  EXPECT_NEAR(response_.cumulative(10 * late), 1.0, 1e-9);
  double last = 0;
  for (int i = 0; i <= 2000; ++i) {
    const double value = response_.cumulative(early + (late - early) * i / 2000);
    EXPECT_GE(value, last - 1e-14);
    last = value;
  }
}

// Time zero is calibrated on the peak of the unbinned response, so it must sit at t = 0.
TEST_P(EveryResponse, PeakIsAtZero) {
  const double h = 0.01 * response_.core_sigma();
  const auto density = [&](double t) {
    return (response_.cumulative(t + h) - response_.cumulative(t - h)) / (2 * h);
  };
  const double top = density(0);
  for (const double distance : {0.05, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0}) {
    // The difference quotient's own rounding is 1e-16 / h; the table's kink is averaged over 2h.
    const double slack = (GetParam().name == "table" ? 0.01 : 1e-9) * top;
    EXPECT_LE(density(distance * response_.core_sigma()), top + slack) << distance;
    EXPECT_LE(density(-distance * response_.core_sigma()), top + slack) << distance;
  }
}

/// Mean and variance of the response from its cumulative: E = b - int F, by the trapezoidal rule.
std::pair<double, double> moments(const ImpulseResponse& response, double blur) {
  const auto [early, late] = response.support(1e-10, blur);
  constexpr int kSteps = 20000;
  const double h = (late - early) / kSteps;
  double first = 0;
  double second = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double t = early + (i + 0.5) * h;
    const double mass = response.cumulative(t + h / 2, blur) - response.cumulative(t - h / 2, blur);
    first += t * mass;
    second += t * t * mass;
  }
  return {first, second - first * first};
}

// Independent spreads add their variances and leave the mean, whatever the response's shape.
TEST_P(EveryResponse, BlurAddsItsVariance) {
  const auto [mean, variance] = moments(response_, 0);
  for (const double factor : {0.3, 1.0, 3.0}) {
    const double blur = std::pow(factor * response_.core_sigma(), 2);
    const auto [blurred_mean, blurred_variance] = moments(response_, blur);
    EXPECT_NEAR(blurred_mean, mean, 1e-5 * response_.core_sigma());
    EXPECT_NEAR(blurred_variance, variance + blur, 1e-4 * (variance + blur));
  }
}

// Blurring is a convolution: the same number by quadrature over the unblurred cumulative.
TEST_P(EveryResponse, BlurIsAConvolution) {
  const double sigma = 0.7 * response_.core_sigma();
  for (const double t : {-2.0, -0.6, 0.0, 0.4, 1.7, 5.0}) {
    double sum = 0;
    constexpr int kSteps = 4000;
    for (int i = 0; i < kSteps; ++i) {
      const double u = 8.0 * ((2 * i + 1.0) / kSteps - 1);
      sum += std::exp(-0.5 * u * u) * response_.cumulative(t * response_.core_sigma() - sigma * u);
    }
    sum *= 16.0 / kSteps / std::sqrt(2 * kPi);
    EXPECT_NEAR(response_.cumulative(t * response_.core_sigma(), sigma * sigma), sum, 1e-5);
  }
}

TEST_P(EveryResponse, SupportHoldsAllButTheStatedShare) {
  for (const double blur : {0.0, 1e-20}) {
    for (const double outside : {1e-2, 1e-4, 1e-7}) {
      const auto [early, late] = response_.support(outside, blur);
      EXPECT_LE(response_.cumulative(early, blur), outside * (1 + 1e-9));
      EXPECT_LE(1 - response_.cumulative(late, blur), outside * (1 + 1e-9));
      // The smallest such times: a hundredth less leaves more outside.
      EXPECT_GT(response_.cumulative(0.99 * early, blur), outside);
      EXPECT_GT(1 - response_.cumulative(0.99 * late, blur), outside);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(ImpulseResponse, EveryResponse, testing::ValuesIn(response_cases()),
                         [](const auto& tested) { return tested.param.name; });

TEST(ImpulseResponseTest, CoreSigmaIsTheWidthAtHalfMaximum) {
  EXPECT_NEAR(ImpulseResponse(GaussianResponse{103e-12}).core_sigma(), 103e-12, 1e-16);
  // A box much wider than its Gaussian edges: full width at half maximum is the box.
  EXPECT_NEAR(ImpulseResponse(BoxGaussianResponse{2e-9, 50e-12}).core_sigma(), 2e-9 / kGaussianFwhm,
              1e-15);
  // A triangle is half as wide at half maximum.
  EXPECT_NEAR(ImpulseResponse(TableResponse{{0, 1e-9, 2e-9}, {0, 5, 0}}).core_sigma(),
              1e-9 / kGaussianFwhm, 1e-15);
}

// Measured on the TMF8828: three bins of 88 ps wide, and 6 %, 2.3 %, 0.43 % of the peak 5, 10 and
// 20 bins later; each figure within half of its last digit.
TEST(ImpulseResponseTest, TailFallsAsMeasured) {
  const ImpulseResponse response(tmf8828());
  constexpr double kBin = 88 * kPicosecond;
  const auto bin = [&](double centre) {
    return response.cumulative((centre + 0.5) * kBin) - response.cumulative((centre - 0.5) * kBin);
  };
  const double top = bin(0);
  EXPECT_NEAR(bin(5) / top, 0.060, 0.0005);
  EXPECT_NEAR(bin(10) / top, 0.023, 0.0005);
  EXPECT_NEAR(bin(20) / top, 0.0043, 0.00005);
  double before = 0;
  while (bin(before) > top / 2) before -= 1e-3;
  double after = 0;
  while (bin(after) > top / 2) after += 1e-3;
  EXPECT_NEAR(after - before, 3.0, 0.05);
}

// Far behind the core only the slowest exponential is left: equal steps, equal factors.
TEST(ImpulseResponseTest, SlowestDecayRulesTheFarTail) {
  const ImpulseResponse response(tmf8828());
  const double decay = 524.6 * kPicosecond;
  for (const double t : {3e-9, 5e-9}) {
    const double ratio = (1 - response.cumulative(t + decay)) / (1 - response.cumulative(t));
    EXPECT_NEAR(ratio, std::exp(-1.0), 1e-6);
  }
}

// A decay far below the core's width or a tail of no energy leaves the Gaussian, without overflow
// in exp(s^2 / 2 d^2).
TEST(ImpulseResponseTest, VanishingTailsLeaveTheCore) {
  const ImpulseResponse core(GaussianResponse{1e-10});
  const ImpulseResponse fast(ExponentialTailResponse{1e-10, {{0.3, 1e-13}}});
  const ImpulseResponse empty(ExponentialTailResponse{1e-10, {{0.0, 3e-10}}});
  for (const double t : {-4e-10, -1e-10, 0.0, 0.7e-10, 3e-10}) {
    // The decay moves 0.3 of the light by 1e-13 s, a thousandth of sigma.
    EXPECT_NEAR(fast.cumulative(t), core.cumulative(t), 1e-3);
    EXPECT_NEAR(empty.cumulative(t), core.cumulative(t), 1e-6);
  }
}

std::string error_for(const ResponseShape& shape) {
  try {
    const ImpulseResponse response(shape);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ImpulseResponseTest, RejectsWhatIsNoDensityAndNamesTheField) {
  EXPECT_NE(error_for(GaussianResponse{0}).find("sigma"), std::string::npos);
  EXPECT_NE(error_for(GaussianResponse{std::nan("")}).find("sigma"), std::string::npos);
  EXPECT_NE(error_for(BoxGaussianResponse{-1e-9, 1e-10}).find("box"), std::string::npos);
  EXPECT_NE(error_for(ExponentialTailResponse{1e-10, {{0.7, 1e-10}, {0.5, 1e-10}}}).find("tails"),
            std::string::npos);
  EXPECT_NE(error_for(ExponentialTailResponse{1e-10, {{0.7, 0}}}).find("decay"), std::string::npos);
  EXPECT_NE(error_for(TableResponse{{0, 1e-9}, {1, -1}}).find("values"), std::string::npos);
  EXPECT_NE(error_for(TableResponse{{0, 0}, {1, 1}}).find("times"), std::string::npos);
  EXPECT_NE(error_for(TableResponse{{0, 1e-9}, {0, 0}}).find("values"), std::string::npos);
  EXPECT_NE(error_for(TableResponse{{0}, {1}}).find("table"), std::string::npos);
}

}  // namespace
}  // namespace blindcorner
