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
#include "forward/support/overloaded.h"

namespace blindcorner {
namespace {

/// log Phi(x) and the ratio phi(x)/Phi(x).
struct NormalTail {
  double log_phi, ratio;
};

/// The exact values, stable in the far tail.
NormalTail exact_normal_tail(double x) {
  if (x > -20) {
    const double p = 0.5 * std::erfc(-x / std::numbers::sqrt2);
    return {std::log(p), std::exp(-0.5 * x * x) / (std::sqrt(2 * kPi) * p)};
  }
  // Phi(x) = phi(x)/(-x) (1 - 1/x^2 + 3/x^4 - ...); the next term is below 105 / 20^8 = 4e-9.
  const double y = 1 / (x * x);
  const double series = 1 - y * (1 - 3 * y * (1 - 5 * y));
  return {-0.5 * x * x - std::log(-x * std::sqrt(2 * kPi)) + std::log(series), -x / series};
}

/// log Phi and phi/Phi on a grid. Cubic interpolation with the exact slopes is good to 1e-8. Few
/// bins lie beyond the grid's ends, where exact_normal_tail() takes over.
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

/// 1 / sigma of each bin.
BLINDCORNER_MULTIVERSION void inverse_sigmas(const double* m, int bins, double floor,
                                             double per_count, double* out) {
  BLINDCORNER_INDEPENDENT
  for (int i = 0; i < bins; ++i) {
    out[i] = 1 / std::sqrt(floor + per_count * std::max(m[i], 0.0));
  }
}

/// Sums of (n - m)^2 / (2 V) and of log(V) / 2. One logarithm is taken of the product of eight
/// bins' variances: a product ends at 1e308, and one variance may be 1e38.
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

/// Mean and variance of the deviance of a Poisson count with mean mu, from a table in 400 steps of
/// 3.8 %. Linear interpolation between the steps errs by 0.038^2 / 8 = 2e-4. Below the table, both
/// are proportional to mu except for a logarithm. Above it, the expansion in 1 / mu takes over.
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

  void add(double mu, double& expected, double& spread) const {
    if (mu >= kHigh) {
      expected += 1 + 1 / (6 * mu);
      spread += 2;
      return;
    }
    const double x = std::max(std::log(mu / kLow) / std::log(kHigh / kLow) * kSteps, 0.0);
    const auto i = static_cast<std::size_t>(std::min(x, kSteps - 1.0));
    const double t = x - static_cast<double>(i);
    const double below = std::min(mu / kLow, 1.0);
    expected += below * (mean[i] * (1 - t) + mean[i + 1] * t);
    spread += below * (variance[i] * (1 - t) + variance[i + 1] * t);
  }
};

/// The number of photons that a Poisson count with this mean exceeds as rarely as a standard normal
/// deviate exceeds `z`.
double poisson_quantile(double mean, double z) {
  // Above this mean, Cornish and Fisher's expansion is good to a twentieth of a photon.
  constexpr double kMany = 30;
  if (mean > kMany) return std::max(std::round(mean + std::sqrt(mean) * z + (z * z - 1) / 6), 0.0);
  double photons = 0;
  double probability = std::exp(-mean);
  double left = 0.5 * std::erfc(-z / std::numbers::sqrt2) - probability;
  while (left > 0 && probability > 0) {
    probability *= mean / ++photons;
    left -= probability;
  }
  return photons;
}

/// A mean is near its count if they differ by less than this share of the count. The series below
/// is then good to 1e-11.
constexpr double kNear = 0.05;

/// (x - log(1 + x)) / x^2 for |x| < kNear.
inline double log_remainder(double x) {
  return 1.0 / 2 -
         x * (1.0 / 3 -
              x * (1.0 / 4 -
                   x * (1.0 / 5 - x * (1.0 / 6 - x * (1.0 / 7 - x * (1.0 / 8 - x / 9))))));
}

/// Signed roots of the deviances of bins whose means are near the counts. Returns the number of
/// bins whose means are not.
BLINDCORNER_MULTIVERSION int poisson_residuals(const double* n, const double* m, int bins,
                                               double scale, double* out) {
  int far = 0;
  for (int i = 0; i < bins; ++i) {
    const double some = std::max(n[i], 1e-300);
    const double d = m[i] - n[i];
    const double x = d / some;
    far += std::abs(x) < kNear ? 0 : 1;
    out[i] = d * std::sqrt(2 * scale * log_remainder(x) / some);
  }
  return far;
}

/// The weights of a row, or ones if the row has none.
const double* weights_of(const CountRow& row) {
  if (row.weight != nullptr) return row.weight;
  thread_local std::vector<double> ones;
  if (ones.size() < static_cast<std::size_t>(row.bins)) {
    ones.resize(static_cast<std::size_t>(row.bins), 1.0);
  }
  return ones.data();
}

/// Sum of the half deviances of bins whose means are near the counts, before the noise model's
/// scale. `far` receives the number of the other bins.
BLINDCORNER_MULTIVERSION double poisson_half_deviance(const double* n, const double* m,
                                                      const double* weight, int bins, int* far) {
  constexpr int kLanes = 8;  // doubles in the widest vector register (512 bits)
  double sums[kLanes] = {};
  int many[kLanes] = {};
  const auto add = [&](int i, int lane) {
    const double some = std::max(n[i], 1e-300);
    const double d = m[i] - n[i];
    const double x = d / some;
    const bool near = std::abs(x) < kNear;
    many[lane] += near ? 0 : 1;
    sums[lane] += near ? weight[i] * d * x * log_remainder(x) : 0.0;
  };
  int i = 0;
  for (; i + kLanes <= bins; i += kLanes) {
    for (int k = 0; k < kLanes; ++k) add(i + k, k);
  }
  for (int k = 0; i < bins; ++i, ++k) add(i, k);
  double sum = 0;
  *far = 0;
  for (int k = 0; k < kLanes; ++k) {
    sum += sums[k];
    *far += many[k];
  }
  return sum;
}

/// Derivatives of the sum of m - n log m with m = amplitude * s + direct * t + ambient.
BLINDCORNER_MULTIVERSION void poisson_terms(const double* n, const double* weight, const double* s,
                                            const double* t, int bins, double amplitude,
                                            double direct, double ambient, double least,
                                            LinearTerms* terms) {
  constexpr int kLanes = 4;  // half as many, because nine sums have to stay in registers
  double ga[kLanes] = {}, gc[kLanes] = {}, gb[kLanes] = {}, haa[kLanes] = {}, hac[kLanes] = {},
         hab[kLanes] = {}, hcc[kLanes] = {}, hcb[kLanes] = {}, hbb[kLanes] = {};
  const auto add = [&](int i, int k) {
    const double si = s[i], ti = t[i];
    const double inverse = 1 / std::max(amplitude * si + direct * ti + ambient, least);
    const double ratio = n[i] * inverse;
    const double d1 = weight[i] * (1 - ratio);
    const double d2 = weight[i] * ratio * inverse;
    ga[k] += d1 * si;
    gc[k] += d1;
    gb[k] += d1 * ti;
    haa[k] += d2 * si * si;
    hac[k] += d2 * si;
    hab[k] += d2 * si * ti;
    hcc[k] += d2;
    hcb[k] += d2 * ti;
    hbb[k] += d2 * ti * ti;
  };
  int i = 0;
  for (; i + kLanes <= bins; i += kLanes) {
    for (int k = 0; k < kLanes; ++k) add(i + k, k);
  }
  for (int k = 0; i < bins; ++i, ++k) add(i, k);
  for (int k = 0; k < kLanes; ++k) {
    terms->ga += ga[k];
    terms->gc += gc[k];
    terms->gb += gb[k];
    terms->haa += haa[k];
    terms->hac += hac[k];
    terms->hab += hab[k];
    terms->hcc += hcc[k];
    terms->hcb += hcb[k];
    terms->hbb += hbb[k];
  }
}

class PoissonLikelihood final : public BinLikelihood {
 public:
  PoissonLikelihood(const PoissonNoise&, double dispersion, double exposures)
      : BinLikelihood(true, exposures / dispersion) {}

  double variance(double m) const override { return m / scale(); }

  Terms terms(double n, double m) const override {
    return {value(n, m), scale() * (1 - n / m), scale() * (n / m) / m};
  }
  double value(double n, double m) const override {
    return scale() * (n > 0 ? m - n * std::log(m) : m);
  }
  double information(double m) const override { return scale() / lit(m); }
  double best(double n) const override { return n; }
  double saturated(double n) const override { return n > 0 ? value(n, n) : 0.0; }
  double half_deviance(double n, double m, double /*least_value*/) const override {
    return scale() * (n > 0 ? m - n + n * std::log(n / std::max(m, kMinMean)) : m);
  }

  double residual(double n, double mean, double /*least_value*/, double best_mean) const override {
    const double m = std::max(mean, kMinMean);
    // This form has no cancellation when m is close to n.
    if (near(n, m)) return (m - n) * std::sqrt(2 * scale() * log_remainder((m - n) / n) / n);
    const double root = std::sqrt(std::max(2 * half_deviance(n, m, 0), 0.0));
    return m >= best_mean ? root : -root;
  }

  void residuals(const CountRow& row, const double* m, const double* saturated, const double* best,
                 double* out) const override {
    int far = poisson_residuals(row.counts, m, row.bins, scale(), out);
    for (int i = 0; i < row.bins && far > 0; ++i) {
      if (near(row.counts[i], m[i])) continue;
      out[i] = PoissonLikelihood::residual(row.counts[i], m[i], saturated[i], best[i]);
      --far;
    }
  }

  void slopes(const CountRow& row, const double* m, double* first, double* second) const override {
    for (int i = 0; i < row.bins; ++i) {
      const double inverse = 1 / std::max(m[i], kMinMean);
      first[i] = scale() * (1 - row.counts[i] * inverse);
      second[i] = scale() * row.counts[i] * inverse * inverse;
    }
  }

  double half_deviance(const CountRow& row, const double* m,
                       double /*saturated_sum*/) const override {
    int far = 0;
    const double* weight = weights_of(row);
    double sum = scale() * poisson_half_deviance(row.counts, m, weight, row.bins, &far);
    for (int i = 0; i < row.bins && far > 0; ++i) {
      if (near(row.counts[i], m[i])) continue;
      sum += weight[i] * PoissonLikelihood::half_deviance(row.counts[i], m[i], 0);
      --far;
    }
    return sum;
  }

  void add_linear_terms(const CountRow& row, const LinearLight& light,
                        LinearTerms& terms) const override {
    thread_local std::vector<double> dark;
    if (dark.size() < static_cast<std::size_t>(row.bins)) {
      dark.resize(static_cast<std::size_t>(row.bins), 0.0);
    }
    LinearTerms sum;
    poisson_terms(row.counts, weights_of(row), light.object != nullptr ? light.object : dark.data(),
                  light.direct != nullptr ? light.direct : dark.data(), row.bins, light.amplitude,
                  light.direct_scale, light.ambient, kMinMean, &sum);
    const double k = scale();
    terms.ga += k * sum.ga;
    terms.gc += k * sum.gc;
    terms.gb += k * sum.gb;
    terms.haa += k * sum.haa;
    terms.hac += k * sum.hac;
    terms.hab += k * sum.hab;
    terms.hcc += k * sum.hcc;
    terms.hcb += k * sum.hcb;
    terms.hbb += k * sum.hbb;
  }

  Terms equal_bins(double bins, double sum, double /*squares*/, double mean) const override {
    const double m = std::max(mean, kMinMean);
    return {scale() * (bins * m - (sum > 0 ? sum * std::log(m) : 0.0)), scale() * (bins - sum / m),
            scale() * (sum / m) / m};
  }

  void add_deviance_moments(std::span<const double> means, double& expected,
                            double& variance) const override {
    static const PoissonDeviance moments;
    for (const double m : means) moments.add(scale() * lit(m), expected, variance);
  }

  double quantile(double mean, double deviate) const override {
    return poisson_quantile(mean * scale(), deviate) / scale();
  }

 private:
  /// The same condition as in the loops over rows.
  static bool near(double n, double m) { return std::abs((m - n) / std::max(n, 1e-300)) < kNear; }

  static constexpr double kMinMean = 1e-300;
};

class GaussianLikelihood final : public BinLikelihood {
 public:
  GaussianLikelihood(const GaussianNoise& noise, double /*dispersion*/, double exposures)
      : BinLikelihood(false, exposures),
        floor_(noise.variance_floor / exposures),
        per_count_(noise.variance_per_count / exposures),
        censored_(noise.censored_at_zero) {}

  bool censored() const override { return censored_; }
  double variance(double m) const override { return floor_ + per_count_ * std::max(m, 0.0); }
  Terms terms(double n, double m) const override;
  double information(double m) const override;
  double best(double n) const override;
  double saturated(double n) const override {
    return censored_ && n <= 0 ? 0 : value(n, best(n));  // P(N <= 0) tends to one
  }
  void slopes(const CountRow& row, const double* m, double* first, double* second) const override;
  double half_deviance(const CountRow& row, const double* m, double saturated_sum) const override;
  using BinLikelihood::half_deviance;
  Terms equal_bins(double bins, double sum, double squares, double m) const override;
  void add_deviance_moments(std::span<const double> means, double& expected,
                            double& variance) const override;
  double quantile(double mean, double deviate) const override {
    const double count = mean + std::sqrt(variance(mean)) * deviate;
    return censored_ ? std::max(count, 0.0) : count;
  }

 private:
  double floor_, per_count_;
  bool censored_;
};

BinLikelihood::Terms GaussianLikelihood::terms(double n, double m) const {
  Terms t;
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

double GaussianLikelihood::information(double m) const {
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
  // The uncensored part has the score of mean and variance, with truncated normal moments. The
  // censored part is its probability times the squared score.
  return (above - x * density) / v + (x * x + 1) * density * slope / (v * sigma) +
         (2 * above - (x * x * x + x) * density) * slope * slope / (4 * v * v) +
         (1 - above) * std::pow(ratio * dx, 2);
}

double GaussianLikelihood::best(double n) const {
  if (censored_ && n <= 0) return -std::numeric_limits<double>::max();
  if (per_count_ <= 0 || n <= 0) return n;
  // Stationary point of (n - m)^2 / (2V) + log(V) / 2 with V = f + k m, a quadratic in m. Below
  // zero, V no longer changes and the value falls towards n > 0, so m = 0 is then the best.
  const double half = floor_ / per_count_ + 0.5 * per_count_;
  const double constant = 2 * n * floor_ / per_count_ + n * n - floor_;
  return std::max(std::sqrt(std::max(half * half + constant, 0.0)) - half, 0.0);
}

void GaussianLikelihood::slopes(const CountRow& row, const double* m, double* first,
                                double* second) const {
  gaussian_slopes(row.counts, m, row.bins, floor_, per_count_, first, second);
  thread_local std::vector<double> inverse;
  if (!row.censored.empty()) {
    inverse.resize(static_cast<std::size_t>(row.bins));
    inverse_sigmas(m, row.bins, floor_, per_count_, inverse.data());
  }
  for (const int i : row.censored) {
    const double inverse_sigma = inverse[static_cast<std::size_t>(i)];
    const double x = -m[i] * inverse_sigma;
    const double ratio = normal_tail_ratio(x);
    const double slope = m[i] > 0 ? per_count_ * inverse_sigma * inverse_sigma : 0.0;
    const double dx = inverse_sigma * (0.5 * m[i] * slope - 1);
    const double ddx = slope * inverse_sigma * (1 - 0.75 * m[i] * slope);
    first[i] = -ratio * dx;
    second[i] = ratio * (x + ratio) * dx * dx - ratio * ddx;
  }
  for (int i = 0; i < row.bins; ++i) {
    if (!(second[i] > 0)) second[i] = information(m[i]);
  }
}

double GaussianLikelihood::half_deviance(const CountRow& row, const double* m,
                                         double saturated_sum) const {
  if (row.weight != nullptr) {
    double sum = -saturated_sum;
    for (int i = 0; i < row.bins; ++i) sum += row.weight[i] * value(row.counts[i], m[i]);
    return sum;
  }
  double total =
      gaussian_sum(row.counts, m, row.counted, row.bins, floor_, per_count_) - saturated_sum;
  for (const int i : row.censored) total -= log_normal_tail(-m[i] / std::sqrt(variance(m[i])));
  return total;
}

BinLikelihood::Terms GaussianLikelihood::equal_bins(double bins, double sum, double squares,
                                                    double m) const {
  Terms t;
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

// The moments come from quadrature.
void GaussianLikelihood::add_deviance_moments(std::span<const double> means, double& expected,
                                              double& variance_sum) const {
  // The range is four standard deviations on either side, and all but 6e-5 lie within it. The steps
  // are a third of one: the rule of even steps errs by exp(-2 pi^2 9) on Gaussians.
  constexpr int kPoints = 24;
  for (const double m : means) {
    double first = 0, second = 0, total = 0;
    for (int i = 0; i <= kPoints; ++i) {
      const double u = 8.0 * i / kPoints - 4;
      const double weight = std::exp(-0.5 * u * u);
      const double n = quantile(m, u);
      const double d = 2 * (value(n, m) - saturated(n));
      first += weight * d;
      second += weight * d * d;
      total += weight;
    }
    const double mean = first / total;
    expected += mean;
    variance_sum += second / total - mean * mean;
  }
}

}  // namespace

void LinearLight::expected(int bins, double* out) const {
  for (int i = 0; i < bins; ++i) {
    out[i] = (object != nullptr ? amplitude * object[i] : 0.0) +
             (direct != nullptr ? direct_scale * direct[i] : 0.0) + ambient;
  }
}

double BinLikelihood::residual(double n, double m, double least_value, double best_mean) const {
  const double root = std::sqrt(std::max(2 * half_deviance(n, m, least_value), 0.0));
  return m >= best_mean ? root : -root;
}

void BinLikelihood::residuals(const CountRow& row, const double* m, const double* saturated,
                              const double* best, double* out) const {
  for (int i = 0; i < row.bins; ++i) out[i] = residual(row.counts[i], m[i], saturated[i], best[i]);
}

void BinLikelihood::add_linear_terms(const CountRow& row, const LinearLight& light,
                                     LinearTerms& terms) const {
  thread_local std::vector<double> mean, first, second;
  const auto bins = static_cast<std::size_t>(row.bins);
  for (auto* v : {&mean, &first, &second}) {
    if (v->size() < bins) v->resize(bins);
  }
  light.expected(row.bins, mean.data());
  slopes(row, mean.data(), first.data(), second.data());
  for (std::size_t i = 0; i < bins; ++i) {
    const double si = light.object != nullptr ? light.object[i] : 0.0;
    const double ti = light.direct != nullptr ? light.direct[i] : 0.0;
    const double weight = row.weight != nullptr ? row.weight[i] : 1.0;
    const double d1 = weight * first[i];
    const double d2 = weight * second[i];
    terms.ga += d1 * si;
    terms.gc += d1;
    terms.gb += d1 * ti;
    terms.haa += d2 * si * si;
    terms.hac += d2 * si;
    terms.hab += d2 * si * ti;
    terms.hcc += d2;
    terms.hcb += d2 * ti;
    terms.hbb += d2 * ti * ti;
  }
}

std::shared_ptr<const BinLikelihood> make_likelihood(const NoiseModel& noise, double dispersion,
                                                     double exposures) {
  using Likelihood = std::shared_ptr<const BinLikelihood>;
  return noise.visit(
      overloaded{[&](const PoissonNoise& model) -> Likelihood {
                   return std::make_shared<PoissonLikelihood>(model, dispersion, exposures);
                 },
                 [&](const GaussianNoise& model) -> Likelihood {
                   return std::make_shared<GaussianLikelihood>(model, dispersion, exposures);
                 }});
}

}  // namespace blindcorner
