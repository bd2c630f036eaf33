// SPDX-License-Identifier: Apache-2.0
#include "forward/sensor/pulse_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <string>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

constexpr double kBin = 88e-12;    // s
constexpr double kOutside = 1e-4;  // share of the energy that may be lost at either end
constexpr int kBins = 400;

struct PulseCase {
  std::string name;
  ResponseShape shape;
};
void PrintTo(const PulseCase& c, std::ostream* out) { *out << c.name; }

std::vector<PulseCase> pulse_cases() {
  return {{"narrow", GaussianResponse{0.3 * kBin}},
          {"gaussian", GaussianResponse{1.2 * kBin}},
          {"box", BoxGaussianResponse{2.5 * kBin, 0.4 * kBin}},
          {"tails", ExponentialTailResponse{243.2e-12 / kGaussianFwhm,
                                            {{0.197, 524.6e-12}, {0.104, 100.8e-12}}}},
          {"wide", GaussianResponse{9 * kBin}}};
}

class EveryPulse : public testing::TestWithParam<PulseCase> {
 protected:
  ImpulseResponse response_{GetParam().shape};
  /// Variance against which blurs are measured: pulse and bin, s^2.
  double own_ = std::pow(response_.core_sigma(), 2) + kBin * kBin / 12;
  PulseTable table_{response_, kBin, 4 * own_, kOutside};

  std::vector<double> row(double position, double blur, double weight = 1.0) const {
    std::vector<double> values(kBins, 0.0);
    table_.add(values.data(), kBins, position, blur, weight);
    return values;
  }
  double exact(int bin, double position, double blur) const {
    return response_.cumulative((bin + 1 - position) * kBin, blur) -
           response_.cumulative((bin - position) * kBin, blur);
  }
  double peak(double position, double blur) const {
    double top = 0;
    for (int k = 0; k < kBins; ++k) top = std::max(top, exact(k, position, blur));
    return top;
  }
};

// Cubic Hermite interpolation over steps of h = 1/32 bin errs by h^4 / 384 times the fourth
// derivative, at most 3 / sigma^4 of a bin's mass: 1e-6 for the narrowest pulse. What the support
// cuts off is at most kOutside in all.
TEST_P(EveryPulse, UnblurredBinsAreExactIntegrals) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> position_of(150, 250);
  const auto [early, late] = response_.support(kOutside);
  for (int i = 0; i < 200; ++i) {
    const double position = position_of(random);
    const auto values = row(position, 0);
    for (int k = 0; k < kBins; ++k) {
      const bool inside = k > position + early / kBin && k + 1 < position + late / kBin;
      EXPECT_NEAR(values[static_cast<std::size_t>(k)], exact(k, position, 0),
                  inside ? 2e-6 : kOutside)
          << "bin " << k << " position " << position;
    }
  }
}

// Blur levels are a quarter of the pulse's own width apart. Linear interpolation between variances
// v and v + d of a bin's mass, which falls as (own + v)^-1/2, errs by at most
// d^2 / 8 * 3/4 (own + v)^-2 of the peak, 6e-3 where d is largest against the variance.
TEST_P(EveryPulse, BlurredBinsAreIntegralsWithinTheInterpolation) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> position_of(150, 250);
  std::uniform_real_distribution<double> root_of(0, 2);
  for (int i = 0; i < 200; ++i) {
    const double position = position_of(random);
    const double blur = own_ * std::pow(root_of(random), 2);
    const auto values = row(position, blur);
    const double tolerance = 7e-3 * peak(position, blur) + kOutside;
    for (int k = 0; k < kBins; ++k) {
      EXPECT_NEAR(values[static_cast<std::size_t>(k)], exact(k, position, blur), tolerance)
          << "bin " << k << " position " << position << " blur " << blur / own_;
    }
  }
}

TEST_P(EveryPulse, EnergyIsConservedAtAnyPositionAndBlur) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> position_of(150, 250);
  std::uniform_real_distribution<double> root_of(0, 3);  // beyond the largest blur as well
  for (int i = 0; i < 500; ++i) {
    const auto values = row(position_of(random), own_ * std::pow(root_of(random), 2), 2.5);
    EXPECT_NEAR(std::accumulate(values.begin(), values.end(), 0.0), 2.5, 2.5 * 2.1 * kOutside);
  }
}

// Ceres differentiates the model: the change of a row with position and blur must not depend on
// the step, at phases of the table and between them.
TEST_P(EveryPulse, DerivativesDoNotDependOnTheStep) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> position_of(150, 250);
  for (int i = 0; i < 100; ++i) {
    // Half of the positions sit on a phase of the table, where a linear table would have a kink.
    const double drawn = position_of(random);
    const double position = i % 2 == 0 ? drawn : std::floor(drawn) + 7.0 / 32;
    const double blur = 0.4 * own_;
    const auto slope = [&](double step) {
      auto after = row(position + step, blur);
      const auto before = row(position - step, blur);
      for (std::size_t k = 0; k < after.size(); ++k) after[k] = (after[k] - before[k]) / (2 * step);
      return after;
    };
    const auto fine = slope(1e-6);
    const auto coarse = slope(1e-3);
    double difference = 0;
    double size = 0;
    for (std::size_t k = 0; k < fine.size(); ++k) {
      difference += std::pow(fine[k] - coarse[k], 2);
      size += std::pow(fine[k], 2);
    }
    // Central differences of a smooth pulse differ by step^2 / 6 over the width squared.
    EXPECT_LT(std::sqrt(difference / size), 1e-3) << position;
  }
}

// Where the pulse's window moves on by a bin only what the support cuts off may change.
TEST_P(EveryPulse, NoStepWhereTheWindowMovesOn) {
  for (const double blur : {0.0, 0.5 * own_}) {
    const auto before = row(200 - 1e-9, blur);
    const auto after = row(200 + 1e-9, blur);
    for (std::size_t k = 0; k < before.size(); ++k) EXPECT_NEAR(before[k], after[k], kOutside);
  }
}

TEST_P(EveryPulse, ReachCoversEveryBinThatIsTouched) {
  for (const double position : {180.0, 200.31, 219.999}) {
    const auto values = row(position, 2 * own_);
    const auto [first, end] = table_.reach(position);
    for (int k = 0; k < kBins; ++k) {
      if (k < first || k >= end) {
        EXPECT_EQ(values[static_cast<std::size_t>(k)], 0.0);
      }
    }
  }
}

// What falls outside the row is lost, the rest is as in a longer row, and no memory beside the row
// is written.
TEST_P(EveryPulse, RowsEndsCutThePulse) {
  constexpr int kShort = 16;
  constexpr double kGuard = 12345.0;
  for (double position = -60; position < 80; position += 0.37) {
    std::vector<double> guarded(3 * kShort, kGuard);
    std::fill_n(guarded.begin() + kShort, kShort, 0.0);
    table_.add(guarded.data() + kShort, kShort, position, 0, 1.0);
    const auto longer = row(position + 200, 0);
    for (int k = 0; k < kShort; ++k) {
      EXPECT_EQ(guarded[static_cast<std::size_t>(k)], kGuard);
      EXPECT_EQ(guarded[static_cast<std::size_t>(2 * kShort + k)], kGuard);
      EXPECT_NEAR(guarded[static_cast<std::size_t>(kShort + k)],
                  longer[static_cast<std::size_t>(200 + k)], 1e-10);
    }
  }
}

TEST_P(EveryPulse, ImpossiblePositionsAddNothing) {
  for (const double position : {std::nan(""), std::numeric_limits<double>::infinity(), -1e9, 1e9}) {
    for (const double value : row(position, 0)) EXPECT_EQ(value, 0.0);
  }
}

TEST_P(EveryPulse, LargerBlursAreTakenAsTheLargest) {
  const auto huge = row(200.3, 1e3 * own_);
  for (const double value : huge) EXPECT_TRUE(std::isfinite(value));
  EXPECT_LE(*std::max_element(huge.begin(), huge.end()), peak(200.3, 3.9 * own_) * 1.01);
}

INSTANTIATE_TEST_SUITE_P(PulseTable, EveryPulse, testing::ValuesIn(pulse_cases()),
                         [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace blindcorner
