// SPDX-License-Identifier: Apache-2.0
/// Likelihood of histogram bins under the sensor's noise model.
#pragma once

#include <algorithm>
#include <memory>
#include <span>

#include "blindcorner/forward/sensor/noise_model.h"

namespace blindcorner {

/// Counts of a row of bins.
struct CountRow {
  const double* counts = nullptr;   ///< [bins]
  const double* counted = nullptr;  ///< [bins] 0 in the censored bins, 1 in the others
  std::span<const int> censored;    ///< bins whose count stands for "zero or less"
  int bins = 0;
  const double* weight = nullptr;  ///< [bins] factor on each bin's log likelihood; null: one
};

/// What a row of bins expects: amplitude * object + direct_scale * direct + ambient.
struct LinearLight {
  const double* object = nullptr;  ///< [bins] at unit amplitude; null: none
  const double* direct = nullptr;  ///< [bins]; null: none
  double amplitude = 0, ambient = 0, direct_scale = 0;

  /// Expected counts, [bins].
  void expected(int bins, double* out) const;
};

/// Derivatives of a negative log likelihood in amplitude (a), ambient (c) and direct scale (b).
struct LinearTerms {
  double ga = 0, gc = 0, gb = 0;
  double haa = 0, hac = 0, hab = 0, hcc = 0, hcb = 0, hbb = 0;
};

/// Negative log likelihood of a count n when m is expected, its derivatives in m, and the Fisher
/// information of m. The constants, which depend on n alone, are chosen so that the deviance is 2
/// (value(n, m) - saturated(n)) >= 0. Photon means below the smallest number are replaced by it.
///
/// Poisson:  value = k (m - n log m), k = exposures / dispersion.
/// Gaussian: value = (n - m)^2 / (2 V) + log(V) / 2 with V = (floor + per_count * max(m, 0)) /
///           exposures; a count stored as zero under censoring has value = -log P(N <= 0).
class BinLikelihood {
 public:
  struct Terms {
    double value = 0, first = 0, second = 0;
  };

  BinLikelihood(bool counts_photons, double scale)
      : counts_photons_(counts_photons), scale_(scale) {}
  virtual ~BinLikelihood() = default;

  /// As NoiseModel::counts_photons(). Means are then above zero, and the sum of the counts of bins
  /// that expect the same tells as much as the single counts.
  bool counts_photons() const { return counts_photons_; }
  /// Exposures, over the dispersion where the noise model has one. Where photons are counted, this
  /// is the number of photons per count.
  double scale() const { return scale_; }
  /// The expected count `m` or, where photons are counted, at least the count of kDarkPhotons
  /// photons. That is far below one photon in all bins together. It is stated in photons, because
  /// counts may be averages over any number of exposures.
  double lit(double m) const { return counts_photons_ ? std::max(m, kDarkPhotons / scale_) : m; }
  /// Whether a count of zero stands for "zero or less".
  virtual bool censored() const { return false; }
  /// Variance of a count when m is expected.
  virtual double variance(double m) const = 0;

  virtual Terms terms(double n, double m) const = 0;
  virtual double value(double n, double m) const { return terms(n, m).value; }
  /// Expected information about m, 1/counts^2.
  virtual double information(double m) const = 0;
  /// The m that explains n best; the lowest double for a censored count (any m far below zero).
  virtual double best(double n) const = 0;
  /// min over m of value(n, m).
  virtual double saturated(double n) const = 0;
  /// value(n, m) - least_value without loss of digits.
  virtual double half_deviance(double n, double m, double least_value) const {
    return value(n, m) - least_value;
  }
  /// sign(m - best(n)) sqrt(2 (value - saturated)).
  virtual double residual(double n, double m, double least_value, double best_mean) const;

  // Rows of bins are what the solver spends its time on.

  /// First and second derivatives of value(n, m) in m, [bins] each. Where the value is not convex
  /// (far from the data), the information replaces the second.
  virtual void slopes(const CountRow& row, const double* m, double* first,
                      double* second) const = 0;
  /// residual() of each bin, [bins], without the row's weights; `saturated` and `best` are those of
  /// the counts.
  virtual void residuals(const CountRow& row, const double* m, const double* saturated,
                         const double* best, double* out) const;
  /// Sum of the half deviances. `saturated_sum` is the sum of the saturated values with the row's
  /// weights.
  virtual double half_deviance(const CountRow& row, const double* m,
                               double saturated_sum) const = 0;
  /// Adds the derivatives of the row's value in the linear unknowns. Curvatures are as in slopes().
  virtual void add_linear_terms(const CountRow& row, const LinearLight& light,
                                LinearTerms& terms) const;
  /// Value and derivatives summed over `bins` uncensored bins that expect the same m. The counts
  /// add up to `sum` and their squares to `squares`. Where bins have weights, `bins` is their sum,
  /// and the other two sums are weighted.
  virtual Terms equal_bins(double bins, double sum, double squares, double m) const = 0;

  /// Adds the mean and the variance of the deviances of counts that expect `means`. For one count
  /// they are one and two only if the count is large.
  virtual void add_deviance_moments(std::span<const double> means, double& expected,
                                    double& variance) const = 0;
  /// The count that is exceeded, when `mean` is expected, as rarely as a standard normal deviate
  /// exceeds `deviate`. Draws made with it change little with the mean and are the same with every
  /// library.
  virtual double quantile(double mean, double deviate) const = 0;

 private:
  static constexpr double kDarkPhotons = 1e-12;

  bool counts_photons_;
  double scale_;
};

/// Likelihood of counts averaged over `exposures`; `dispersion` is a single exposure's.
std::shared_ptr<const BinLikelihood> make_likelihood(const NoiseModel& noise, double dispersion,
                                                     double exposures);

}  // namespace blindcorner
