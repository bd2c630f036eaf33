// SPDX-License-Identifier: Apache-2.0
#include "forward/sensor/pulse_table.h"

#include <algorithm>
#include <cmath>

#include "forward/sensor/least_pulse.h"
#include "forward/support/multiversion.h"

namespace blindcorner {

PulseTable::PulseTable(const ImpulseResponse& response, double bin_width, double max_blur,
                       double outside) {
  // Levels are an eighth of the pulse's own width apart: linear interpolation in variance is then
  // good to 6e-3 of the blur's effect.
  const double own = std::hypot(response.core_sigma(), bin_width / std::sqrt(12.0));
  level_step_ = own / 8;
  levels_ = 2 + static_cast<int>(std::ceil(std::sqrt(std::max(max_blur, 0.0)) / level_step_));
  for (int l = 0; l < levels_; ++l) variances_.push_back(std::pow(l * level_step_, 2));

  const double least_blur = least_pulse_blur(response, bin_width);
  const auto [early, late] = response.support(outside, variances_.back() + least_blur);
  first_ = static_cast<int>(std::floor(early / bin_width));
  length_ = static_cast<int>(std::ceil(late / bin_width)) + 1 - first_;
  length_ = (length_ + 7) / 8 * 8;
  table_.assign(
      static_cast<std::size_t>(levels_) * (kPhases + 1) * 2 * static_cast<std::size_t>(length_),
      0.0);
  const double step = 1.0 / kPhases;
  const double h = 1e-3 * std::clamp(response.core_sigma() / bin_width, kMinPulseBins, 1.0);
  for (int l = 0; l < levels_; ++l) {
    const double blur = variances_[static_cast<std::size_t>(l)] + least_blur;
    const auto integral = [&](double bin_edge, double phase) {
      return response.cumulative((bin_edge - phase) * bin_width, blur);
    };
    for (int p = 0; p <= kPhases; ++p) {
      double* value = const_cast<double*>(entry(l, p, 0));
      double* slope = const_cast<double*>(entry(l, p, 1));
      const double phase = p * step;
      double low = integral(first_, phase);
      double low_slope = integral(first_, phase + h) - integral(first_, phase - h);
      for (int k = 0; k < length_; ++k) {
        const double edge = first_ + k + 1;
        const double high = integral(edge, phase);
        const double high_slope = integral(edge, phase + h) - integral(edge, phase - h);
        value[k] = high - low;
        slope[k] = (high_slope - low_slope) / (2 * h) * step;
        low = high;
        low_slope = high_slope;
      }
    }
  }
}

std::pair<int, int> PulseTable::reach(double position) const {
  const int start = static_cast<int>(std::floor(position)) + first_;
  return {start, start + length_};
}

namespace {

/// The eight tabulated rows around a position (two phases, value and slope, at two blur levels) and
/// their weights.
struct Mixture {
  const double* rows[8];
  double weights[8];
};

BLINDCORNER_MULTIVERSION void add_mixture(const Mixture& m, int begin, int end, double* out) {
  const double *r0 = m.rows[0], *r1 = m.rows[1], *r2 = m.rows[2], *r3 = m.rows[3];
  const double *r4 = m.rows[4], *r5 = m.rows[5], *r6 = m.rows[6], *r7 = m.rows[7];
  const double w0 = m.weights[0], w1 = m.weights[1], w2 = m.weights[2], w3 = m.weights[3];
  const double w4 = m.weights[4], w5 = m.weights[5], w6 = m.weights[6], w7 = m.weights[7];
  for (int k = begin; k < end; ++k) {
    out[k] += (w0 * r0[k] + w1 * r1[k] + w2 * r2[k] + w3 * r3[k]) +
              (w4 * r4[k] + w5 * r5[k] + w6 * r6[k] + w7 * r7[k]);
  }
}

}  // namespace

void PulseTable::add(double* row, int bins, double position, double blur, double weight) const {
  if (!(position > -1e6 && position < 1e6)) return;
  const double whole = std::floor(position);
  const int start = static_cast<int>(whole) + first_;
  const int begin = std::max(0, -start);
  const int end = std::min(length_, bins - start);
  if (begin >= end) return;

  const double scaled = (position - whole) * kPhases;
  const int phase = std::min(static_cast<int>(scaled), kPhases - 1);
  const double u = scaled - phase;
  // Cubic Hermite basis.
  const double h01 = u * u * (3 - 2 * u);
  const double h10 = u * (1 - u) * (1 - u);
  const double h11 = -u * u * (1 - u);

  const double clamped = std::clamp(blur, 0.0, variances_.back());
  const int level = std::min(static_cast<int>(std::sqrt(clamped) / level_step_), levels_ - 2);
  const double low = variances_[static_cast<std::size_t>(level)];
  const double high = variances_[static_cast<std::size_t>(level) + 1];
  const double t = std::clamp((clamped - low) / (high - low), 0.0, 1.0);

  const double a = weight * (1 - t);
  const double b = weight * t;
  const Mixture mixture = {
      {entry(level, phase, 0), entry(level, phase, 1), entry(level, phase + 1, 0),
       entry(level, phase + 1, 1), entry(level + 1, phase, 0), entry(level + 1, phase, 1),
       entry(level + 1, phase + 1, 0), entry(level + 1, phase + 1, 1)},
      {a * (1 - h01), a * h10, a * h01, a * h11, b * (1 - h01), b * h10, b * h01, b * h11}};
  add_mixture(mixture, begin, end, row + start);
}

}  // namespace blindcorner
