// SPDX-License-Identifier: Apache-2.0
/// Bin-integrated pulses, tabulated once per instrument.
#pragma once

#include <vector>

#include "blindcorner/forward/sensor/impulse_response.h"

namespace blindcorner {

/// Adds pulses of any arrival time and any extra Gaussian blur to a histogram row. Each bin gets
/// the exact integral of the response over it, interpolated between tabulated sub-bin phases
/// (cubic Hermite) and blur levels (linear in variance), so the sum is smooth in both.
class PulseTable {
 public:
  /// `bin_width` in s; `max_blur` is the largest extra variance asked for, s^2 (larger ones are
  /// taken as this); `outside` is the share of the energy that may be cut off at either end.
  PulseTable(const ImpulseResponse& response, double bin_width, double max_blur,
             double outside = 1e-4);

  /// Adds `weight` times the pulse to `row` [bins]. `position` is the arrival time of its peak in
  /// bins (bin k covers [k, k+1)); `blur` the extra variance in s^2. What falls outside is lost.
  void add(double* row, int bins, double position, double blur, double weight) const;

  /// First and one past the last bin that a pulse at `position` can reach.
  std::pair<int, int> reach(double position) const;

 private:
  static constexpr int kPhases = 32;

  const double* entry(int level, int phase, int derivative) const {
    return table_.data() +
           ((static_cast<std::ptrdiff_t>(level) * (kPhases + 1) + phase) * 2 + derivative) *
               length_;
  }

  int levels_ = 1;
  int length_ = 0;                 // bins per entry
  int first_ = 0;                  // offset of the first bin of an entry from floor(position)
  std::vector<double> variances_;  // s^2, increasing, [levels]
  double level_step_ = 0;          // s, spacing of the levels' standard deviations
  std::vector<double> table_;      // [level][phase][value, derivative][bin]
};

}  // namespace blindcorner
