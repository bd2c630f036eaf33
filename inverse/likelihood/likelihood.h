// SPDX-License-Identifier: Apache-2.0
/// Likelihood of one histogram bin under the sensor's noise law.
#pragma once

#include <span>

#include "blindcorner/forward/sensor/sensor.h"

namespace blindcorner {

/// Negative log likelihood of a count n when m is expected, its derivatives in m, and the Fisher
/// information of m. Constants that depend on n alone are chosen so that the deviance is
/// 2 (value(n, m) - least(n)) >= 0.
///
/// Poisson:  value = k (m - n log m), k = exposures / dispersion.
/// Gaussian: value = (n - m)^2 / (2 V) + log(V) / 2 with V = (floor + per_count * max(m, 0)) /
///           exposures; a count stored as zero under censoring has value = -log P(N <= 0).
class BinLikelihood {
 public:
  struct Terms {
    double value = 0, first = 0, second = 0;
  };

  BinLikelihood(const NoiseLaw& law, double dispersion, double exposures);

  bool poisson() const { return poisson_; }
  bool censored() const { return censored_; }
  /// Effective exposures: k of the Poisson law, the exposures of the Gaussian one.
  double scale() const { return scale_; }

  Terms terms(double n, double m) const;
  /// First and second derivatives of value(n, m) in m for a row of bins, Gaussian law only. Where
  /// the value is not convex (far from the data) the information stands for the second. `censored`
  /// lists the bins whose count stands for "zero or less".
  void slopes(const double* n, const double* m, int bins, std::span<const int> censored,
              double* first, double* second) const;
  /// Sum of value(n, m) over a row of bins, Gaussian law only. `counted` is 0 in the censored bins
  /// and 1 in the others.
  double sum(const double* n, const double* m, const double* counted, int bins,
             std::span<const int> censored) const;
  /// Value and derivatives summed over `bins` uncensored bins that expect the same m, of counts
  /// that add up to `sum` and whose squares add up to `squares`; value without constants.
  Terms equal_bins(double bins, double sum, double squares, double m) const;
  double value(double n, double m) const;
  /// Expected information about m, 1/counts^2.
  double information(double m) const;
  /// min over m of value(n, m).
  double least(double n) const;
  /// The m that explains n best; the lowest double for a censored count (any m far below zero).
  double best(double n) const;
  /// sign(m - best(n)) sqrt(2 (value - least)).
  double residual(double n, double m, double least_value, double best_mean) const;
  /// Adds mean and variance of the deviances of counts that expect `means`: one and two only where
  /// counts are many.
  void add_deviance_moments(std::span<const double> means, double& expected,
                            double& variance) const;
  /// Variance of a count when m is expected.
  double variance(double m) const;

 private:
  bool poisson_;
  double scale_ = 1;
  double floor_ = 1, per_count_ = 0;
  bool censored_ = false;
};

}  // namespace blindcorner
