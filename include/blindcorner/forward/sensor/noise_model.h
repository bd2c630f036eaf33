// SPDX-License-Identifier: Apache-2.0
/// How counts scatter about their expected values. Each noise model is a type in this file. Its
/// likelihood is in inverse/likelihood/likelihood.cpp, and src/io/sensor_reader.cpp reads its
/// fields from scene files.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <utility>
#include <variant>

namespace blindcorner {

/// Variance of one exposure's counts, floor + per_count * mean: `floor` in counts^2, `per_count` in
/// counts.
struct VarianceLine {
  double floor = 0, per_count = 0;
};

/// Photon counts: variance = dispersion * mean.
struct PoissonNoise {
  static constexpr const char* kName = "Poisson";
  static constexpr bool kCountsPhotons = true;

  double variance(double mean, double dispersion) const { return dispersion * mean; }
  std::optional<VarianceLine> stated_line() const { return std::nullopt; }
  void state_line(const VarianceLine&) {}

  template <class Random>
  void draw(double* counts, int bins, double exposures, double dispersion, Random& random) const {
    const double scale = exposures / dispersion;
    for (int k = 0; k < bins; ++k) {
      if (counts[k] <= 0) continue;
      std::poisson_distribution<long long> poisson(counts[k] * scale);
      counts[k] = static_cast<double>(poisson(random)) / scale;
    }
  }
};

/// Gaussian counts, such as those of a sensor that subtracts its own background: variance = floor +
/// per_count * expected signal. Negative values are valid data.
struct GaussianNoise {
  static constexpr const char* kName = "Gaussian";
  static constexpr bool kCountsPhotons = false;

  double variance_floor = 1.0;      ///< counts^2
  double variance_per_count = 0.0;  ///< counts
  bool censored_at_zero = false;    ///< values below zero were stored as zero

  double variance(double mean, double /*dispersion*/) const {
    return variance_floor + variance_per_count * std::max(mean, 0.0);
  }
  std::optional<VarianceLine> stated_line() const {
    return VarianceLine{variance_floor, variance_per_count};
  }
  void state_line(const VarianceLine& line) {
    variance_floor = line.floor;
    variance_per_count = line.per_count;
  }

  template <class Random>
  void draw(double* counts, int bins, double exposures, double dispersion, Random& random) const {
    std::normal_distribution<double> normal;
    for (int k = 0; k < bins; ++k) {
      counts[k] += std::sqrt(variance(counts[k], dispersion) / exposures) * normal(random);
      if (censored_at_zero) counts[k] = std::max(counts[k], 0.0);
    }
  }
};

/// One of the noise models above.
struct NoiseModel : std::variant<PoissonNoise, GaussianNoise> {
  using Base = std::variant<PoissonNoise, GaussianNoise>;
  using Base::Base;

  /// Calls a function with the model's own type.
  template <class Function>
  decltype(auto) visit(Function&& function) const {
    return std::visit(std::forward<Function>(function), static_cast<const Base&>(*this));
  }

  const char* name() const {
    return visit([](const auto& model) { return model.kName; });
  }
  /// Whether the counts are photons. Photon counts are never negative, and the sum over bins of
  /// equal expectation tells as much as the single bins. Other counts were processed by the sensor.
  bool counts_photons() const {
    return visit([](const auto& model) { return model.kCountsPhotons; });
  }
  /// Variance (counts^2) of one exposure whose expected count is `mean`. `dispersion` is the
  /// sensor's.
  double variance(double mean, double dispersion) const {
    return visit([&](const auto& model) { return model.variance(mean, dispersion); });
  }
  /// The variance line that the model states; nothing where the dispersion gives the variance.
  std::optional<VarianceLine> stated_line() const {
    return visit([](const auto& model) { return model.stated_line(); });
  }
  /// Sets the variance line, if the model states one.
  void state_line(const VarianceLine& line) {
    std::visit([&](auto& model) { model.state_line(line); }, static_cast<Base&>(*this));
  }
  /// Replaces the expected counts of a row of bins by random counts, averaged over `exposures`.
  template <class Random>
  void draw(double* counts, int bins, double exposures, double dispersion, Random& random) const {
    visit([&](const auto& model) { model.draw(counts, bins, exposures, dispersion, random); });
  }
};

}  // namespace blindcorner
