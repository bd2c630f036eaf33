// SPDX-License-Identifier: Apache-2.0
/// Rows about random counts.
#include <cmath>

#include "blindcorner/forward/sensor/photon_noise.h"
#include "stability/cases.h"
#include "stability/themes.h"

namespace blindcorner {
namespace {

const char* const kPhotonTheme = "Random counts";
/// Bins that share one mean: enough to measure moments.
constexpr int kBins = 20'000;

/// One zone whose bins all expect `mean`.
struct Flat {
  Scene scene;
  HistogramCube expected;

  Flat(int bins, double mean, double cycles) : expected(1, 1, bins) {
    scene = wall_scene();
    scene.sensor.bins = bins;
    scene.sensor.pile_up_cycles = cycles;
    for (double& value : expected.values) value = mean;
  }
  HistogramCube draw(double exposures) const { return draw_counts(scene, expected, exposures, 7); }
};

/// How far the mean and the variance of the drawn bins are from Poisson's, in standard errors: the
/// larger one.
StabilityMeasurement poisson_moments(double mean) {
  const HistogramCube drawn = Flat(kBins, mean, 0).draw(1);
  double sum = 0, square = 0;
  for (const double value : drawn.values) {
    sum += (value - mean) / std::sqrt(mean);
    square += std::pow(value - mean, 2) / mean;
  }
  const double n = kBins;
  const double spread = std::sqrt(n * (2 + 1 / mean));  // of the sum of squares
  return {std::max(std::abs(sum) / std::sqrt(n), std::abs(square - n) / spread), ""};
}

StabilityRow moments_row(const std::string& name, double mean) {
  return {name,
          kPhotonTheme,
          "20,000 Poisson counts of the mean that the name gives: mean and variance against it, "
          "in standard errors, the larger",
          5,
          "standard errors",
          LimitOrigin::physics,
          "Photon counts have a variance equal to their mean; five standard errors come up once in "
          "a million tables.",
          [=] { return poisson_moments(mean); }};
}

/// Largest deviation of a bin, in standard deviations. The light is such that every second cycle
/// catches a photon in the first bin, and half of the free cycles do in each further bin.
StabilityMeasurement piled_up(double exposures) {
  const double cycles = 1000;
  Flat flat(8, 0, cycles);
  double free = 1;
  for (double& value : flat.expected.values) value = cycles * (free /= 2);
  const HistogramCube drawn = flat.draw(exposures);
  double worst = 0;
  for (std::size_t k = 0; k < drawn.values.size(); ++k) {
    const double share = flat.expected.values[k] / cycles;
    const double sigma = std::sqrt(cycles * share * (1 - share) / exposures);
    worst = std::max(worst, std::abs(drawn.values[k] - flat.expected.values[k]) / sigma);
  }
  return {worst, ""};
}

}  // namespace

std::vector<StabilityRow> photon_rows() {
  const auto piled_row = [](const std::string& name, double exposures) {
    return StabilityRow{name,
                        kPhotonTheme,
                        "Averages of so many exposures of 1000 cycles, half of the free cycles hit "
                        "in each of 8 bins: largest deviation of a bin",
                        5,
                        "standard deviations",
                        LimitOrigin::physics,
                        "Each bin is binomial; of 8 bins one is five standard deviations off once "
                        "in 200,000 draws.",
                        [=] { return piled_up(exposures); }};
  };
  return {
      moments_row("poisson_1e-3", 1e-3),         moments_row("poisson_1e8", 1e8),
      moments_row("poisson_1e10", 1e10),         moments_row("poisson_1e18", 1e18),
      moments_row("poisson_1e30", 1e30),         piled_row("pile_up_1_exposure", 1),
      piled_row("pile_up_1e9_exposures", 1e9),   piled_row("pile_up_1e14_exposures", 1e14),
      piled_row("pile_up_1e20_exposures", 1e20),
  };
}

}  // namespace blindcorner
