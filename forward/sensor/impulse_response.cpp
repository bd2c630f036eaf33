// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/sensor/impulse_response.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "forward/support/overloaded.h"

namespace blindcorner {
namespace {

double normal_cumulative(double t, double sigma) {
  if (sigma <= 0) return t < 0 ? 0.0 : 1.0;
  return 0.5 * std::erfc(-t / (sigma * std::numbers::sqrt2));
}

double normal_density(double t, double sigma) {
  const double u = t / sigma;
  return std::exp(-0.5 * u * u) / (sigma * std::sqrt(2 * kPi));
}

/// Integral of the normal cumulative: E[(t - X)+] for X ~ N(0, sigma^2).
double normal_cumulative_integral(double t, double sigma) {
  if (sigma <= 0) return std::max(t, 0.0);
  return t * normal_cumulative(t, sigma) + sigma * sigma * normal_density(t, sigma);
}

/// exp(x^2) erfc(x) without overflow for x > 0 (continued fraction for large x).
double scaled_erfc(double x) {
  if (x < 25) return std::exp(x * x) * std::erfc(x);
  const double y = 1 / (2 * x * x);
  return (1 - y * (1 - 3 * y * (1 - 5 * y))) / (x * std::sqrt(kPi));
}

/// exp(s^2 / (2 d^2) - t/d) Phi(t/s - s/d): the part that an exponential decay d takes away from
/// the cumulative of a Gaussian.
double exponential_part(double t, double sigma, double decay) {
  if (sigma <= 0) return t < 0 ? 0.0 : std::exp(-t / decay);
  const double x = (sigma / decay - t / sigma) / std::numbers::sqrt2;
  if (x > 0) {
    const double u = t / sigma;
    return 0.5 * std::exp(-0.5 * u * u) * scaled_erfc(x);
  }
  return 0.5 * std::exp(0.5 * sigma * sigma / (decay * decay) - t / decay) * std::erfc(x);
}

void require(bool condition, const char* field, const char* accepted) {
  if (!condition) throw Error(std::string("impulse_response.") + field, accepted);
}

void validate(const ResponseShape& shape) {
  std::visit(
      overloaded{
          [](const GaussianResponse& s) { require(s.sigma > 0, "sigma", "accepted: > 0"); },
          [](const BoxGaussianResponse& s) {
            require(s.box > 0, "box", "accepted: > 0");
            require(s.sigma > 0, "sigma", "accepted: > 0");
          },
          [](const ExponentialTailResponse& s) {
            require(s.sigma > 0, "sigma", "accepted: > 0");
            double total = 0;
            for (const Tail& tail : s.tails) {
              require(tail.fraction >= 0, "fraction", "accepted: >= 0");
              require(tail.decay > 0, "decay", "accepted: > 0");
              total += tail.fraction;
            }
            require(total <= 1, "tails", "accepted: fractions with a sum of at most 1");
          },
          [](const TableResponse& s) {
            require(s.times.size() >= 2 && s.times.size() == s.values.size(), "table",
                    "accepted: at least two times, and as many values");
            double largest = 0;
            for (std::size_t i = 0; i < s.times.size(); ++i) {
              require(s.values[i] >= 0 && std::isfinite(s.values[i]), "values", "accepted: >= 0");
              require(i == 0 || s.times[i] > s.times[i - 1], "times", "accepted: increasing");
              largest = std::max(largest, s.values[i]);
            }
            require(largest > 0, "values", "accepted: at least one above 0");
          }},
      shape);
}

/// Cumulative of a piecewise-linear density, convolved with a Gaussian of variance `blur`. Without
/// blur it has a closed form. With blur, that form is integrated numerically.
double table_cumulative(const TableResponse& s, const std::vector<double>& integral, double t,
                        double blur) {
  if (blur <= 0) {
    if (t <= s.times.front()) return 0;
    if (t >= s.times.back()) return 1;
    const auto it = std::upper_bound(s.times.begin(), s.times.end(), t);
    const auto i = static_cast<std::size_t>(it - s.times.begin()) - 1;
    const double width = s.times[i + 1] - s.times[i];
    const double u = t - s.times[i];
    const double slope = (s.values[i + 1] - s.values[i]) / width;
    const double total = integral.back();
    return (integral[i] + u * (s.values[i] + 0.5 * slope * u)) / total;
  }
  // The Gaussian is sampled in steps of a twentieth of sigma. Trapezoid sums over it converge
  // exponentially.
  const double sigma = std::sqrt(blur);
  constexpr int kSteps = 128;
  double sum = 0;
  double weight = 0;
  for (int i = -kSteps; i <= kSteps; ++i) {
    const double u = 6.0 * i / kSteps;
    const double w = std::exp(-0.5 * u * u);
    sum += w * table_cumulative(s, integral, t - sigma * u, 0);
    weight += w;
  }
  return sum / weight;
}

}  // namespace

ImpulseResponse::ImpulseResponse(ResponseShape shape) : shape_(std::move(shape)) {
  validate(shape_);
  if (const auto* table = std::get_if<TableResponse>(&shape_)) {
    table_integral_.assign(table->times.size(), 0.0);
    for (std::size_t i = 1; i < table->times.size(); ++i) {
      table_integral_[i] = table_integral_[i - 1] + 0.5 *
                                                        (table->values[i] + table->values[i - 1]) *
                                                        (table->times[i] - table->times[i - 1]);
    }
    const auto it = std::max_element(table->values.begin(), table->values.end());
    peak_ = table->times[static_cast<std::size_t>(it - table->values.begin())];
  } else if (const auto* tail = std::get_if<ExponentialTailResponse>(&shape_)) {
    // The peak lies between the core's centre and a few sigma after it. Golden section finds it.
    double low = -tail->sigma;
    double high = 4 * tail->sigma;
    const double ratio = (std::sqrt(5.0) - 1) / 2;
    for (int i = 0; i < 80; ++i) {
      const double a = high - ratio * (high - low);
      const double b = low + ratio * (high - low);
      (density_from_origin(a) > density_from_origin(b) ? high : low) =
          density_from_origin(a) > density_from_origin(b) ? b : a;
    }
    peak_ = 0.5 * (low + high);
  }
  // Full width at half maximum by bisection on both flanks.
  const double top = density_from_origin(peak_);
  const auto half_point = [&](double direction) {
    double inner = 0;
    double outer = 1e-13;
    while (density_from_origin(peak_ + direction * outer) > 0.5 * top && outer < 1) outer *= 2;
    for (int i = 0; i < 80; ++i) {
      const double middle = 0.5 * (inner + outer);
      (density_from_origin(peak_ + direction * middle) > 0.5 * top ? inner : outer) = middle;
    }
    return inner;
  };
  core_sigma_ = (half_point(1) + half_point(-1)) / kGaussianFwhm;
}

double ImpulseResponse::density_from_origin(double t) const {
  return std::visit(
      overloaded{[&](const GaussianResponse& s) { return normal_density(t, s.sigma); },
                 [&](const BoxGaussianResponse& s) {
                   return (normal_cumulative(t + s.box / 2, s.sigma) -
                           normal_cumulative(t - s.box / 2, s.sigma)) /
                          s.box;
                 },
                 [&](const ExponentialTailResponse& s) {
                   double rest = 1;
                   double density = 0;
                   for (const Tail& tail : s.tails) {
                     density +=
                         tail.fraction / tail.decay * exponential_part(t, s.sigma, tail.decay);
                     rest -= tail.fraction;
                   }
                   return density + rest * normal_density(t, s.sigma);
                 },
                 [&](const TableResponse& s) {
                   if (t <= s.times.front() || t >= s.times.back()) return 0.0;
                   const auto it = std::upper_bound(s.times.begin(), s.times.end(), t);
                   const auto i = static_cast<std::size_t>(it - s.times.begin()) - 1;
                   const double u = (t - s.times[i]) / (s.times[i + 1] - s.times[i]);
                   return (s.values[i] * (1 - u) + s.values[i + 1] * u) / table_integral_.back();
                 }},
      shape_);
}

double ImpulseResponse::cumulative_from_origin(double t, double blur) const {
  return std::visit(overloaded{[&](const GaussianResponse& s) {
                                 return normal_cumulative(t, std::sqrt(s.sigma * s.sigma + blur));
                               },
                               [&](const BoxGaussianResponse& s) {
                                 const double sigma = std::sqrt(s.sigma * s.sigma + blur);
                                 return (normal_cumulative_integral(t + s.box / 2, sigma) -
                                         normal_cumulative_integral(t - s.box / 2, sigma)) /
                                        s.box;
                               },
                               [&](const ExponentialTailResponse& s) {
                                 const double sigma = std::sqrt(s.sigma * s.sigma + blur);
                                 double value = normal_cumulative(t, sigma);
                                 for (const Tail& tail : s.tails) {
                                   value -= tail.fraction * exponential_part(t, sigma, tail.decay);
                                 }
                                 return value;
                               },
                               [&](const TableResponse& s) {
                                 return table_cumulative(s, table_integral_, t, blur);
                               }},
                    shape_);
}

double ImpulseResponse::cumulative(double t, double blur) const {
  return std::clamp(cumulative_from_origin(t + peak_, blur), 0.0, 1.0);
}

std::pair<double, double> ImpulseResponse::support(double outside, double blur) const {
  const auto edge = [&](double direction) {
    const auto beyond = [&](double distance) {
      const double value = cumulative(direction * distance, blur);
      return direction > 0 ? 1 - value : value;
    };
    double outer = core_sigma_;
    while (beyond(outer) > outside && outer < 1e-3) outer *= 1.5;
    double inner = 0;
    for (int i = 0; i < 50; ++i) {
      const double middle = 0.5 * (inner + outer);
      (beyond(middle) > outside ? inner : outer) = middle;
    }
    return outer;
  };
  return {-edge(-1), edge(1)};
}

}  // namespace blindcorner
