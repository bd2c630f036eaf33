// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/likelihood.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

struct NoiseCase {
  std::string name;
  NoiseModel noise;
  double dispersion = 1;
  double exposures = 1;

  std::shared_ptr<const BinLikelihood> likelihood() const {
    return make_likelihood(noise, dispersion, exposures);
  }
  bool poisson() const { return noise.counts_photons(); }
  bool censored() const {
    const auto* gaussian = std::get_if<GaussianNoise>(&noise);
    return gaussian != nullptr && gaussian->censored_at_zero;
  }
};
void PrintTo(const NoiseCase& c, std::ostream* out) { *out << c.name; }

std::vector<NoiseCase> noise_cases() {
  return {{"poisson", PoissonNoise{}, 1, 1},
          {"poisson_averaged", PoissonNoise{}, 2.5, 40},
          {"gaussian", GaussianNoise{100, 0, false}, 1, 1},
          {"gaussian_shot", GaussianNoise{100, 15, false}, 1, 4},
          {"censored", GaussianNoise{100, 0, true}, 1, 1},
          {"censored_shot", GaussianNoise{100, 3, true}, 1, 2}};
}

class EveryNoiseModel : public testing::TestWithParam<NoiseCase> {
 protected:
  const std::shared_ptr<const BinLikelihood> owner_ = GetParam().likelihood();
  const BinLikelihood& law_ = *owner_;
  /// Counts and means that occur together, none of them at a kink (m = 0).
  std::vector<std::pair<double, double>> points() const {
    std::vector<std::pair<double, double>> list;
    for (const double n : {0.0, 1.0, 7.0, 60.0, 900.0}) {
      for (const double m : {0.3, 2.0, 8.0, 55.0, 1000.0}) list.emplace_back(n, m);
    }
    if (!GetParam().poisson()) {
      list.insert(list.end(), {{5.0, -3.0}, {30.0, -12.0}, {0.0, -15.0}});
      if (!GetParam().censored()) list.insert(list.end(), {{-14.0, 6.0}, {-8.0, -9.0}});
    }
    return list;
  }
};

// Newton's method and the gradient of the fit rest on these derivatives. A central difference of
// step h is right to h^2 / 6 of the third derivative and to rounding / h.
TEST_P(EveryNoiseModel, DerivativesAgreeWithDifferences) {
  for (const auto& [n, m] : points()) {
    const double h = 1e-4 * std::max(std::abs(m), 0.1);
    const BinLikelihood::Terms t = law_.terms(n, m);
    EXPECT_EQ(t.value, law_.value(n, m));
    const double first = (law_.value(n, m + h) - law_.value(n, m - h)) / (2 * h);
    const double second = (law_.terms(n, m + h).first - law_.terms(n, m - h).first) / (2 * h);
    const double rounding = 1e-15 * std::abs(t.value) / h;
    EXPECT_NEAR(t.first, first, 1e-6 * std::abs(first) + 10 * rounding + 1e-9)
        << "n " << n << " m " << m;
    EXPECT_NEAR(t.second, second, 1e-5 * std::abs(second) + 1e-9) << "n " << n << " m " << m;
  }
}

// Rows of bins are what the solver works with; bin by bin they must say the same.
TEST_P(EveryNoiseModel, RowsAgreeWithBins) {
  std::vector<double> n, m, counted;
  std::vector<int> censored;
  double sum = 0, saturated = 0;
  for (const auto& [count, mean] : points()) {
    const bool cut = GetParam().censored() && count <= 0;
    if (cut) censored.push_back(static_cast<int>(n.size()));
    counted.push_back(cut ? 0.0 : 1.0);
    n.push_back(count);
    m.push_back(mean);
    sum += law_.value(count, mean) - law_.saturated(count);
    saturated += law_.saturated(count);
  }
  const CountRow row{n.data(), counted.data(), censored, static_cast<int>(n.size())};
  EXPECT_NEAR(law_.half_deviance(row, m.data(), saturated), sum, 1e-7 * std::abs(sum));
  std::vector<double> first(n.size()), second(n.size());
  law_.slopes(row, m.data(), first.data(), second.data());
  for (std::size_t i = 0; i < n.size(); ++i) {
    const BinLikelihood::Terms t = law_.terms(n[i], m[i]);
    EXPECT_NEAR(first[i], t.first, 1e-6 * std::abs(t.first) + 1e-9) << n[i] << " " << m[i];
    const bool convex = t.second > 0 || GetParam().poisson();
    const double expected = convex ? t.second : law_.information(m[i]);
    EXPECT_NEAR(second[i], expected, 1e-6 * std::abs(expected) + 1e-9) << n[i] << " " << m[i];
  }
}

// Derivatives in the linear unknowns are those in the means times the shapes, whichever of object
// and direct return there is.
TEST_P(EveryNoiseModel, LinearTermsAgreeWithSlopes) {
  const std::vector<double> n{3, 8, 0, 5, 41}, object{0, 2, 0.5, 7, 30}, direct{4, 0, 1, 0.1, 2};
  const std::vector<double> counted{1, 1, GetParam().censored() ? 0.0 : 1.0, 1, 1};
  const std::vector<int> censored(GetParam().censored() ? 1 : 0, 2);
  const CountRow row{n.data(), counted.data(), censored, 5};
  for (const bool with_direct : {false, true}) {
    const LinearLight light{object.data(), with_direct ? direct.data() : nullptr, 1.2, 3, 0.8};
    std::vector<double> m(5), first(5), second(5);
    light.expected(5, m.data());
    law_.slopes(row, m.data(), first.data(), second.data());
    LinearTerms want, got;
    for (std::size_t i = 0; i < 5; ++i) {
      const double t = with_direct ? direct[i] : 0;
      EXPECT_EQ(m[i], 1.2 * object[i] + 0.8 * t + 3);
      want.ga += first[i] * object[i];
      want.gb += first[i] * t;
      want.hac += second[i] * object[i];
      want.hab += second[i] * object[i] * t;
    }
    law_.add_linear_terms(row, light, got);
    EXPECT_NEAR(got.ga, want.ga, 1e-12 * (1 + std::abs(want.ga)));
    EXPECT_NEAR(got.gb, want.gb, 1e-12 * (1 + std::abs(want.gb)));
    EXPECT_NEAR(got.hac, want.hac, 1e-12 * (1 + std::abs(want.hac)));
    EXPECT_NEAR(got.hab, want.hab, 1e-12 * (1 + std::abs(want.hab)));
  }
}

// Drawn by normal deviates, counts have the mean and the variance that the likelihood expects.
TEST_P(EveryNoiseModel, QuantilesHaveMeanAndVariance) {
  if (GetParam().censored()) return;
  constexpr int kSteps = 100000;
  for (const double m : {0.02, 3.0, 500.0}) {
    double total = 0, first = 0, second = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double u = -8 + 16 * (i + 0.5) / kSteps;
      const double weight = std::exp(-0.5 * u * u);
      const double n = law_.quantile(m, u);
      total += weight;
      first += weight * n;
      second += weight * (n - m) * (n - m);
    }
    const double variance = law_.variance(m);
    EXPECT_NEAR(first / total, m, 1e-3 * std::sqrt(variance));
    EXPECT_NEAR(second / total, variance, 5e-3 * variance);
  }
}

// Bins that expect the same are summed without looking at them one by one.
TEST_P(EveryNoiseModel, EqualBinsAgreeWithBins) {
  if (GetParam().censored()) return;
  const std::vector<double> counts{3, 8, 0, 5, 5, 12};
  for (const double m : {0.4, 5.0, 90.0}) {
    double sum = 0, squares = 0, value = 0, first = 0, second = 0;
    for (const double n : counts) {
      const BinLikelihood::Terms t = law_.terms(n, m);
      sum += n;
      squares += n * n;
      value += t.value;
      first += t.first;
      second += t.second;
    }
    const BinLikelihood::Terms all = law_.equal_bins(6, sum, squares, m);
    EXPECT_NEAR(all.value, value, 1e-9 * (1 + std::abs(value)));
    EXPECT_NEAR(all.first, first, 1e-9 * (1 + std::abs(first)));
    if (second > 0) {
      EXPECT_NEAR(all.second, second, 1e-9 * (1 + std::abs(second)));
    } else {
      EXPECT_GT(all.second, 0);
    }
  }
}

// The saturated value is a bound that the best mean attains: the deviance is never negative,
// whatever mean the fit tries (a sensor that subtracts its background may have a negative one).
TEST_P(EveryNoiseModel, LeastIsTheMinimumOverAllMeans) {
  for (const double n : {0.0, 0.5, 1.0, 7.0, 60.0, 900.0, -14.0}) {
    if (n < 0 && (GetParam().poisson() || GetParam().censored())) continue;
    const double saturated = law_.saturated(n);
    if (n > 0 || !GetParam().poisson()) {
      EXPECT_NEAR(law_.value(n, law_.best(n)), saturated, 1e-9 * (1 + std::abs(saturated)));
    }
    double lowest = 1e300;
    double where = 0;
    for (double m = GetParam().poisson() ? 0.01 : -60; m < 1100; m += 0.37) {
      const double value = law_.value(n, m);
      if (value < lowest) where = m;
      lowest = std::min(lowest, value);
    }
    EXPECT_GE(lowest, saturated - 1e-9 * (1 + std::abs(saturated))) << "n " << n << " m " << where;
  }
}

// Least squares on the residuals is maximum likelihood only if half the square is the deviance.
TEST_P(EveryNoiseModel, HalfTheSquaredResidualIsTheExcess) {
  for (const auto& [n, m] : points()) {
    const double saturated = GetParam().poisson() ? 0 : law_.saturated(n);
    const double best = law_.best(n);
    const double residual = law_.residual(n, m, saturated, best);
    const double excess = law_.value(n, m) - law_.saturated(n);
    if (std::isfinite(excess)) {
      EXPECT_NEAR(0.5 * residual * residual, excess, 1e-9 * (1 + std::abs(law_.value(n, m))))
          << "n " << n << " m " << m;
    }
    if (std::abs(residual) > 1e-9) {
      EXPECT_EQ(residual > 0, m >= best);
    }
  }
}

// Smooth through its zero: the root of a small difference must not lose its digits.
TEST_P(EveryNoiseModel, ResidualIsSmoothAtTheBestMean) {
  const double n = 80;
  const double best = law_.best(n);
  const double saturated = GetParam().poisson() ? 0 : law_.saturated(n);
  const double h = 0.02 * best;
  const double slope =
      (law_.residual(n, best + h, saturated, best) - law_.residual(n, best - h, saturated, best)) /
      (2 * h);
  // Near the optimum the residual is sqrt(second derivative) times the distance.
  EXPECT_NEAR(slope, std::sqrt(law_.terms(n, best).second), 0.02 * slope);
  if (GetParam().poisson()) {
    for (const double x : {-2e-3, -0.9999e-3, -1e-6, 1e-6, 1.0001e-3}) {
      const double m = n * (1 + x);
      const double series = std::sqrt(law_.scale() * n) * x * (1 - x / 3 + 7 * x * x / 36);
      // The next term of the series is of the order of x^3.
      const double tolerance = (1e-9 + std::pow(std::abs(x), 3)) * std::abs(series);
      EXPECT_NEAR(law_.residual(n, m, 0, n), series, tolerance) << x;
    }
  }
}

// Counts may be averages over any number of exposures: what is dark is so in photons. (With means
// held above 1e-12 of a count, dark bins of captures in W/m^2 told next to nothing.)
TEST(Poisson, UnitOfCountsDoesNotMatter) {
  const NoiseModel noise = PoissonNoise{};
  const auto photons = make_likelihood(noise, 1, 1);
  const auto averages = make_likelihood(noise, 1, 1e16);
  for (const double m : {0.0, 1e-13, 1e-6, 0.1, 3.0}) {
    EXPECT_NEAR(averages->information(1e-16 * m) / 1e32 / photons->information(m), 1, 1e-9) << m;
  }
}

/// Expected squared score by summing over counts or integrating over values.
double expected_information(const NoiseCase& noise_case, double m) {
  const auto owner = noise_case.likelihood();
  const BinLikelihood& noise_model = *owner;
  double sum = 0;
  if (noise_case.poisson()) {
    const double photons = noise_model.scale() * m;
    const double most = photons + 12 * std::sqrt(photons) + 30;
    for (int j = 0; j < most; ++j) {
      const double probability = std::exp(j * std::log(photons) - photons - std::lgamma(j + 1.0));
      sum += probability * std::pow(noise_model.terms(j / noise_model.scale(), m).first, 2);
    }
    return sum;
  }
  const double sigma = std::sqrt(noise_model.variance(m));
  constexpr int kSteps = 20000;
  const double step = 16 * sigma / kSteps;
  double below = 1;
  for (int i = 0; i < kSteps; ++i) {
    const double u = -8 + 16 * (i + 0.5) / kSteps;
    const double n = m + u * sigma;
    if (noise_case.censored() && n <= 0) continue;
    const double probability = std::exp(-0.5 * u * u) / std::sqrt(2 * kPi) * step / sigma;
    sum += probability * std::pow(noise_model.terms(n, m).first, 2);
    below -= probability;
  }
  if (noise_case.censored()) {
    below = 0.5 * std::erfc(m / sigma / std::sqrt(2.0));
    sum += below * std::pow(noise_model.terms(0, m).first, 2);
  }
  return sum;
}

// Fisher information is the variance of the score. The quadrature is good to 1e-3 where censoring
// cuts a step in two, and exact otherwise.
TEST_P(EveryNoiseModel, InformationIsTheExpectedSquaredScore) {
  for (const double m : {0.2, 3.0, 12.0, 40.0, 500.0}) {
    const double exact = expected_information(GetParam(), m);
    EXPECT_NEAR(law_.information(m), exact, 2e-3 * exact) << "m " << m;
  }
}

TEST_P(EveryNoiseModel, VarianceIsThatOfTheCounts) {
  const NoiseCase& c = GetParam();
  for (const double m : {0.5, 20.0, 300.0}) {
    const auto* g = std::get_if<GaussianNoise>(&c.noise);
    const double want = g == nullptr
                            ? c.dispersion * m / c.exposures
                            : (g->variance_floor + g->variance_per_count * m) / c.exposures;
    EXPECT_NEAR(law_.variance(m), want, 1e-12 * want);
  }
}

INSTANTIATE_TEST_SUITE_P(Likelihood, EveryNoiseModel, testing::ValuesIn(noise_cases()),
                         [](const auto& tested) { return tested.param.name; });

// No counts at all is the commonest datum of a single-photon sensor.
TEST(LikelihoodTest, ZeroCountsGiveFiniteTerms) {
  const auto poisson = make_likelihood(PoissonNoise{}, 1, 1);
  for (const double m : {1e-300, 1e-9, 1.0}) {
    const BinLikelihood::Terms t = poisson->terms(0, m);
    EXPECT_NEAR(t.value, m, 1e-15 * m);
    EXPECT_EQ(t.first, 1);
    EXPECT_EQ(t.second, 0);
    EXPECT_NEAR(poisson->residual(0, m, 0, 0), std::sqrt(2 * m), 1e-12 * std::sqrt(m));
  }
}

// Far below and far above zero the censored terms come from an asymptotic series: no overflow, and
// no step where it takes over (20 standard deviations).
TEST(LikelihoodTest, CensoredTermsAreFiniteAndContinuousInTheTails) {
  const auto owner = make_likelihood(GaussianNoise{1, 0, true}, 1, 1);
  const BinLikelihood& noise_model = *owner;
  for (const double m : {-40.0, -25.0, 25.0, 1e3, 1e6}) {
    const BinLikelihood::Terms t = noise_model.terms(0, m);
    EXPECT_TRUE(std::isfinite(t.value) && std::isfinite(t.first) && std::isfinite(t.second)) << m;
    EXPECT_GE(t.value, 0);
    EXPECT_GE(t.first, 0);
    // Deep in the tail -log Phi(-m) is m^2/2 + log(m) + ..., of slope m.
    if (m > 0) {
      EXPECT_NEAR(t.first, m, 0.05 * m);
      EXPECT_NEAR(t.second, 1, 0.05);
    }
    EXPECT_TRUE(std::isfinite(noise_model.information(m)));
  }
  const auto before = noise_model.terms(0, 20 - 1e-9);
  const auto after = noise_model.terms(0, 20 + 1e-9);
  EXPECT_NEAR(before.value, after.value, 1e-6 * after.value);
  EXPECT_NEAR(before.first, after.first, 1e-5 * after.first);
  EXPECT_NEAR(before.second, after.second, 1e-3);
}

// Rows take a series where means are near the counts, and logarithms elsewhere: both are right, and
// neither leaves a step.
TEST(LikelihoodTest, RowsOfPhotonsAreRightNearTheirCountsAndFarFromThem) {
  const auto owner = make_likelihood(PoissonNoise{}, 1, 4);
  const BinLikelihood& noise_model = *owner;
  std::vector<double> counts, means, saturated, best;
  for (const double n : {0.0, 1.0, 250.0, 1e5, 3e8}) {
    for (const double ratio :
         {0.3, 0.949999, 0.950001, 0.999999, 1.0, 1.02, 1.049999, 1.050001, 2.0}) {
      counts.push_back(n);
      means.push_back(std::max(n, 0.5) * ratio);
      saturated.push_back(noise_model.saturated(n));
      best.push_back(noise_model.best(n));
    }
  }
  const std::vector<double> counted(counts.size(), 1.0);
  const CountRow row{counts.data(), counted.data(), {}, static_cast<int>(counts.size()), nullptr};
  std::vector<double> residuals(counts.size());
  noise_model.residuals(row, means.data(), saturated.data(), best.data(), residuals.data());
  long double sum = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const long double n = counts[i], m = means[i];
    const long double half = 4 * (n > 0 ? m - n + n * std::log(n / m) : m);
    sum += half;
    const auto expected = static_cast<double>(std::sqrt(2 * std::max(half, 0.0L)));
    EXPECT_NEAR(std::abs(residuals[i]), expected, 1e-7 * expected + 1e-6) << counts[i];
    EXPECT_GE(residuals[i] * (means[i] - counts[i]), 0);
  }
  EXPECT_NEAR(noise_model.half_deviance(row, means.data(), 0), static_cast<double>(sum),
              1e-9 * static_cast<double>(sum));
}

}  // namespace
}  // namespace blindcorner
