// SPDX-License-Identifier: Apache-2.0
#include "inverse/likelihood/likelihood.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "forward/support/multiversion.h"

namespace blindcorner {
namespace {

/// log Phi(x) and the ratio phi(x)/Phi(x).
struct NormalTail {
  double log_phi, ratio;
};

/// Stable in the far tail.
NormalTail exact_normal_tail(double x) {
  if (x > -20) {
    const double p = 0.5 * std::erfc(-x / std::numbers::sqrt2);
    return {std::log(p), std::exp(-0.5 * x * x) / (std::sqrt(2 * kPi) * p)};
  }
  // Phi(x) = phi(x)/(-x) (1 - 1/x^2 + 3/x^4 - ...).
  const double y = 1 / (x * x);
  const double series = 1 - y * (1 - 3 * y * (1 - 5 * y));
  return {-0.5 * x * x - std::log(-x * std::sqrt(2 * kPi)) + std::log(series), -x / series};
}

/// log Phi and phi/Phi on a grid; cubic interpolation with the exact slopes, good to 1e-8.
class NormalTailTable {
 public:
  static constexpr double kLowest = -12;
  static constexpr double kHighest = 4;
  static constexpr int kPerUnit = 32;

  NormalTailTable() {
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const double x = kLowest + static_cast<double>(i) / kPerUnit;
      const NormalTail exact = exact_normal_tail(x);
      nodes_[i] = {exact.log_phi, exact.ratio, -exact.ratio * (x + exact.ratio)};
    }
  }

  static bool covers(double x) { return x >= kLowest && x < kHighest; }

  double log_phi(double x) const {
    const Place p = place(x);
    return hermite(p.t, p.a.log_phi, p.b.log_phi, p.a.ratio, p.b.ratio);
  }
  double ratio(double x) const {
    const Place p = place(x);
    return hermite(p.t, p.a.ratio, p.b.ratio, p.a.ratio_slope, p.b.ratio_slope);
  }

 private:
  struct Node {
    double log_phi = 0, ratio = 0, ratio_slope = 0;
  };
  struct Place {
    const Node &a, &b;
    double t;  // from a to b
  };
  Place place(double x) const {
    const double position = (x - kLowest) * kPerUnit;
    const auto i = static_cast<std::size_t>(position);
    return {nodes_[i], nodes_[i + 1], position - static_cast<double>(i)};
  }
  static double hermite(double t, double from, double to, double slope_from, double slope_to) {
    constexpr double kStep = 1.0 / kPerUnit;
    const double u = 1 - t;
    return (1 + 2 * t) * u * u * from + (3 - 2 * t) * t * t * to +
           kStep * t * u * (u * slope_from - t * slope_to);
  }

  std::array<Node, static_cast<std::size_t>((kHighest - kLowest) * kPerUnit) + 2> nodes_;
};

const NormalTailTable kNormalTail;

/// log Phi(x).
double log_normal_tail(double x) {
  return NormalTailTable::covers(x) ? kNormalTail.log_phi(x) : exact_normal_tail(x).log_phi;
}

/// phi(x) / Phi(x).
double normal_tail_ratio(double x) {
  return NormalTailTable::covers(x) ? kNormalTail.ratio(x) : exact_normal_tail(x).ratio;
}

}  // namespace

BinLikelihood::BinLikelihood(const NoiseLaw& law, double dispersion, double exposures)
    : poisson_(std::holds_alternative<PoissonNoise>(law)) {
  if (poisson_) {
    scale_ = exposures / dispersion;
  } else {
    scale_ = exposures;
    const auto& gaussian = std::get<GaussianNoise>(law);
    floor_ = gaussian.variance_floor / exposures;
    per_count_ = gaussian.variance_per_count / exposures;
    censored_ = gaussian.censored_at_zero;
  }
}

double BinLikelihood::variance(double m) const {
  if (poisson_) return m / scale_;
  return floor_ + per_count_ * std::max(m, 0.0);
}

BinLikelihood::Terms BinLikelihood::terms(double n, double m) const {
  Terms t;
  if (poisson_) {
    t.value = scale_ * (n > 0 ? m - n * std::log(m) : m);
    t.first = scale_ * (1 - n / m);
    t.second = scale_ * (n / m) / m;
    return t;
  }
  const double v = variance(m);
  const double slope = m > 0 ? per_count_ : 0.0;
  if (censored_ && n <= 0) {
    const double sigma = std::sqrt(v);
    const double x = -m / sigma;
    const double ratio = normal_tail_ratio(x);
    const double dx = -1 / sigma + 0.5 * m * slope / (v * sigma);
    const double ddx = slope / (v * sigma) - 0.75 * m * slope * slope / (v * v * sigma);
    t.value = -log_normal_tail(x);
    t.first = -ratio * dx;
    t.second = ratio * (x + ratio) * dx * dx - ratio * ddx;
    return t;
  }
  const double d = n - m;
  t.value = 0.5 * d * d / v + 0.5 * std::log(v);
  t.first = -d / v - 0.5 * d * d * slope / (v * v) + 0.5 * slope / v;
  t.second = 1 / v + 2 * d * slope / (v * v) + d * d * slope * slope / (v * v * v) -
             0.5 * slope * slope / (v * v);
  return t;
}

namespace {

BLINDCORNER_MULTIVERSION void gaussian_slopes(const double* n, const double* m, int bins,
                                              double floor, double per_count, double* first,
                                              double* second) {
  BLINDCORNER_INDEPENDENT
  for (int i = 0; i < bins; ++i) {
    const double inverse = 1 / (floor + per_count * std::max(m[i], 0.0));
    const double slope = m[i] > 0 ? per_count * inverse : 0.0;
    const double d = n[i] - m[i];
    const double square = d * d * inverse;
    first[i] = -d * inverse - 0.5 * slope * (square - 1);
    second[i] = inverse + 2 * d * slope * inverse + slope * slope * (square - 0.5);
  }
}

/// 1 / sigma, row by row.
BLINDCORNER_MULTIVERSION void inverse_sigmas(const double* m, int bins, double floor,
                                             double per_count, double* out) {
  BLINDCORNER_INDEPENDENT
  for (int i = 0; i < bins; ++i) {
    out[i] = 1 / std::sqrt(floor + per_count * std::max(m[i], 0.0));
  }
}

/// Sums of (n - m)^2 / (2 V) and of log(V) / 2, the logarithm taken of eight bins at a time.
BLINDCORNER_MULTIVERSION double gaussian_sum(const double* n, const double* m,
                                             const double* counted, int bins, double floor,
                                             double per_count) {
  constexpr int kTogether = 8;
  double squares = 0;
  double logs = 0;
  int i = 0;
  for (; i + kTogether <= bins; i += kTogether) {
    std::array<double, kTogether> variance;
    double part = 0;
    for (int k = 0; k < kTogether; ++k) {
      const double v = floor + per_count * std::max(m[i + k], 0.0);
      const double d = n[i + k] - m[i + k];
      part += counted[i + k] * d * d / v;
      variance[static_cast<std::size_t>(k)] = 1 + counted[i + k] * (v - 1);
    }
    squares += part;
    double product = 1;
    for (const double v : variance) product *= v;
    logs += std::log(product);
  }
  for (; i < bins; ++i) {
    const double v = floor + per_count * std::max(m[i], 0.0);
    const double d = n[i] - m[i];
    squares += counted[i] * d * d / v;
    logs += std::log(1 + counted[i] * (v - 1));
  }
  return 0.5 * (squares + logs);
}

}  // namespace

double BinLikelihood::sum(const double* n, const double* m, const double* counted, int bins,
                          std::span<const int> censored) const {
  double total = gaussian_sum(n, m, counted, bins, floor_, per_count_);
  for (const int i : censored) {
    total -= log_normal_tail(-m[i] / std::sqrt(variance(m[i])));
  }
  return total;
}

void BinLikelihood::slopes(const double* n, const double* m, int bins,
                           std::span<const int> censored, double* first, double* second) const {
  gaussian_slopes(n, m, bins, floor_, per_count_, first, second);
  thread_local std::vector<double> inverse;
  if (!censored.empty()) {
    inverse.resize(static_cast<std::size_t>(bins));
    inverse_sigmas(m, bins, floor_, per_count_, inverse.data());
  }
  for (const int i : censored) {
    const double inverse_sigma = inverse[static_cast<std::size_t>(i)];
    const double x = -m[i] * inverse_sigma;
    const double ratio = normal_tail_ratio(x);
    const double slope = m[i] > 0 ? per_count_ * inverse_sigma * inverse_sigma : 0.0;
    const double dx = inverse_sigma * (0.5 * m[i] * slope - 1);
    const double ddx = slope * inverse_sigma * (1 - 0.75 * m[i] * slope);
    first[i] = -ratio * dx;
    second[i] = ratio * (x + ratio) * dx * dx - ratio * ddx;
  }
  for (int i = 0; i < bins; ++i) {
    if (!(second[i] > 0)) second[i] = information(m[i]);
  }
}

BinLikelihood::Terms BinLikelihood::equal_bins(double bins, double sum, double squares,
                                               double m) const {
  Terms t;
  if (poisson_) {
    t.value = scale_ * (bins * m - (sum > 0 ? sum * std::log(m) : 0.0));
    t.first = scale_ * (bins - sum / m);
    t.second = scale_ * (sum / m) / m;
    return t;
  }
  const double v = variance(m);
  const double slope = m > 0 ? per_count_ / v : 0.0;
  const double d = sum - bins * m;
  const double square = std::max(squares - 2 * m * sum + bins * m * m, 0.0) / v;
  t.value = 0.5 * square + 0.5 * bins * std::log(v);
  t.first = -d / v - 0.5 * slope * (square - bins);
  t.second = bins / v + 2 * d * slope / v + slope * slope * (square - 0.5 * bins);
  if (!(t.second > 0)) t.second = bins * information(m);
  return t;
}

double BinLikelihood::value(double n, double m) const {
  if (poisson_) return scale_ * (n > 0 ? m - n * std::log(m) : m);
  return terms(n, m).value;
}

double BinLikelihood::information(double m) const {
  if (poisson_) return scale_ / m;
  const double v = variance(m);
  const double slope = m > 0 ? per_count_ : 0.0;
  const double own = 0.5 * slope * slope / (v * v);
  if (!censored_) return 1 / v + own;
  // Information of a normal mean censored at zero (Tobit).
  const double x = m / std::sqrt(v);
  const double ratio = normal_tail_ratio(-x);  // phi(x) / Phi(-x)
  const double density = std::exp(-0.5 * x * x) / std::sqrt(2 * kPi);
  const double above = 0.5 * std::erfc(-x / std::numbers::sqrt2);
  const double sigma = std::sqrt(v);
  const double dx = -1 / sigma + 0.5 * m * slope / (v * sigma);
  // Uncensored part: score of mean and variance, truncated normal moments; censored part: its
  // probability times the squared score.
  return (above - x * density) / v + (x * x + 1) * density * slope / (v * sigma) +
         (2 * above - (x * x * x + x) * density) * slope * slope / (4 * v * v) +
         (1 - above) * std::pow(ratio * dx, 2);
}

double BinLikelihood::best(double n) const {
  if (poisson_) return n;
  if (censored_ && n <= 0) return -std::numeric_limits<double>::max();
  if (per_count_ <= 0 || n <= 0) return n;
  // Stationary point of (n - m)^2 / (2V) + log(V) / 2 with V = f + k m, a quadratic in m; below
  // zero V no longer changes and the value falls towards n > 0, so m = 0 is then the best.
  const double half = floor_ / per_count_ + 0.5 * per_count_;
  const double constant = 2 * n * floor_ / per_count_ + n * n - floor_;
  return std::max(std::sqrt(std::max(half * half + constant, 0.0)) - half, 0.0);
}

double BinLikelihood::least(double n) const {
  if (!poisson_ && censored_ && n <= 0) return 0;  // P(N <= 0) tends to one
  return value(n, best(n));
}

double BinLikelihood::residual(double n, double m, double least_value, double best_mean) const {
  double half = 0;
  if (poisson_) {
    // n log(n/m) + m - n without cancellation where m is close to n.
    const double x = n > 0 ? (m - n) / n : 0;
    if (n > 0 && std::abs(x) < 1e-3) {
      half = scale_ * n * x * x * (0.5 - x * (1.0 / 3 - x * 0.25));
    } else {
      half = scale_ * (n > 0 ? m - n + n * std::log(n / m) : m);
    }
  } else {
    half = value(n, m) - least_value;
  }
  const double root = std::sqrt(std::max(2 * half, 0.0));
  return m >= best_mean ? root : -root;
}

namespace {

/// Mean and variance of the deviance of a Poisson count with mean mu.
struct PoissonDeviance {
  static constexpr double kLow = 1e-4, kHigh = 300;
  static constexpr int kSteps = 400;
  std::vector<double> mean, variance;

  PoissonDeviance() {
    for (int i = 0; i <= kSteps; ++i) {
      const double mu = kLow * std::pow(kHigh / kLow, static_cast<double>(i) / kSteps);
      const int last = static_cast<int>(mu + 12 * std::sqrt(mu) + 30);
      double first = 0;
      double second = 0;
      double log_probability = -mu;
      for (int n = 0; n <= last; ++n) {
        if (n > 0) log_probability += std::log(mu / n);
        const double d = 2 * (n > 0 ? mu - n + n * std::log(n / mu) : mu);
        first += std::exp(log_probability) * d;
        second += std::exp(log_probability) * d * d;
      }
      mean.push_back(first);
      variance.push_back(second - first * first);
    }
  }

  void at(double mu, double& e, double& v) const {
    if (mu >= kHigh) {
      e = 1 + 1 / (6 * mu);
      v = 2;
      return;
    }
    const double x = std::max(std::log(mu / kLow) / std::log(kHigh / kLow) * kSteps, 0.0);
    const auto i = static_cast<std::size_t>(std::min(x, kSteps - 1.0));
    const double t = x - static_cast<double>(i);
    e = mean[i] * (1 - t) + mean[i + 1] * t;
    v = variance[i] * (1 - t) + variance[i + 1] * t;
    if (mu < kLow) {
      e *= mu / kLow;
      v *= mu / kLow;
    }
  }
};

/// Mean and variance of the deviance of a Gaussian-law count with mean m, by quadrature.
void gaussian_deviance_moments(const BinLikelihood& law, double m, double& e, double& v) {
  constexpr int kPoints = 24;
  const double sigma = std::sqrt(law.variance(m));
  double first = 0, second = 0, total = 0;
  for (int i = 0; i <= kPoints; ++i) {
    const double u = 8.0 * i / kPoints - 4;
    const double weight = std::exp(-0.5 * u * u);
    const double n = law.censored() ? std::max(m + sigma * u, 0.0) : m + sigma * u;
    const double d = 2 * (law.value(n, m) - law.least(n));
    first += weight * d;
    second += weight * d * d;
    total += weight;
  }
  e = first / total;
  v = second / total - e * e;
}

}  // namespace

void BinLikelihood::add_deviance_moments(std::span<const double> means, double& expected,
                                         double& variance) const {
  static const PoissonDeviance poisson;
  for (const double m : means) {
    double e = 0;
    double v = 0;
    if (poisson_) {
      poisson.at(std::max(scale_ * m, 1e-12), e, v);
    } else {
      gaussian_deviance_moments(*this, m, e, v);
    }
    expected += e;
    variance += v;
  }
}

}  // namespace blindcorner
