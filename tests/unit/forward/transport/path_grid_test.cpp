// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/path_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

using Paths = PathGrid::Paths;

constexpr int kBins = 96;

struct Case {
  std::string name;
  double bin_width;  // s
  ResponseShape response;
};

std::vector<Case> cases() {
  return {{"fine_bins", 20e-12, GaussianResponse{150e-12}},
          {"even_bins", 100e-12, GaussianResponse{130e-12}},
          {"coarse_bins", 1e-9, GaussianResponse{120e-12}},
          {"box", 100e-12, BoxGaussianResponse{600e-12, 100e-12}},
          {"tail", 88e-12, ExponentialTailResponse{110e-12, {{0.3, 400e-12}}}}};
}

Sensor sensor_of(const Case& c) {
  Sensor sensor;
  sensor.rows = 1;
  sensor.columns = 2;
  sensor.zones.assign(2, Zone{});
  sensor.zones[0].time_zero = 3.37 * c.bin_width;
  sensor.zones[1].time_zero = -1.81 * c.bin_width;
  sensor.bins = kBins;
  sensor.bin_width = c.bin_width;
  sensor.response = ImpulseResponse(c.response);
  return sensor;
}

struct Leg {
  double path, weight;
};

/// Light of all pairs of legs, by the grid.
std::vector<double> by_grid(const PathGrid& grid, int zone, const std::vector<Leg>& in,
                            const std::vector<Leg>& out) {
  const auto splines = [&](const std::vector<Leg>& legs) {
    std::vector<double> paths, weights;
    for (const Leg& leg : legs) {
      paths.push_back(leg.path);
      weights.push_back(leg.weight);
    }
    PathGrid::Splines found;
    grid.find_splines(paths.data(), weights.data(), static_cast<int>(legs.size()), found);
    return found;
  };
  const auto lay = [&](const std::vector<Leg>& legs) {
    PathLight light;
    grid.lay(splines(legs), 0, legs.size(), light);
    return light;
  };
  PathLight pairs;
  if (grid.paths() == Paths::whole) {
    for (const Leg& a : in) {
      std::vector<Leg> whole = out;
      for (Leg& leg : whole) leg = {a.path + leg.path, a.weight * leg.weight};
      grid.add(splines(whole), 0, whole.size(), pairs);
    }
  } else {
    grid.pair(lay(in), lay(out), 1.0, pairs);
  }
  std::vector<double> row(kBins, 0.0);
  grid.add_to_row(zone, pairs, row.data());
  return row;
}

/// The same by the response's own integral.
std::vector<double> exact(const Sensor& sensor, double extra_variance, int zone,
                          const std::vector<Leg>& in, const std::vector<Leg>& out) {
  std::vector<double> row(kBins, 0.0);
  for (const Leg& a : in) {
    for (const Leg& b : out) {
      const double arrival = sensor.zones[static_cast<std::size_t>(zone)].time_zero +
                             (a.path + b.path) / kSpeedOfLight;
      for (int k = 0; k < kBins; ++k) {
        const double low = k * sensor.bin_width - arrival;
        row[static_cast<std::size_t>(k)] +=
            a.weight * b.weight *
            (sensor.response.cumulative(low + sensor.bin_width, extra_variance) -
             sensor.response.cumulative(low, extra_variance));
      }
    }
  }
  return row;
}

double worst(const std::vector<double>& got, const std::vector<double>& want) {
  double error = 0, peak = 0;
  for (std::size_t k = 0; k < want.size(); ++k) {
    error = std::max(error, std::abs(got[k] - want[k]));
    peak = std::max(peak, want[k]);
  }
  return error / peak;
}

/// Legs that together end well within the time axis.
std::vector<Leg> legs(const Sensor& sensor, int count, unsigned seed) {
  const double axis = kBins * sensor.bin_width * kSpeedOfLight;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> path(0.1 * axis, 0.35 * axis), weight(0.1, 1);
  std::vector<Leg> list;
  for (int i = 0; i < count; ++i) list.push_back({path(random), weight(random)});
  return list;
}

class PathGridCase : public testing::TestWithParam<std::tuple<std::size_t, Paths>> {
 protected:
  Sensor sensor() const { return sensor_of(cases()[std::get<0>(GetParam())]); }
  static Paths paths() { return std::get<1>(GetParam()); }
};

// A single pulse is the worst case: errors between cells do not average out. The grid takes a tenth
// of the tolerance between the cells that it looks at, so a fifth is allowed between all.
TEST_P(PathGridCase, OnePulseIsRightToItsShareOfTheTolerance) {
  const Sensor s = sensor();
  for (const double tolerance : {0.1, 0.01, 0.001}) {
    const PathGrid grid(s, paths(), 0.0, kBins, 0.0, tolerance);
    for (unsigned seed = 0; seed < 40; ++seed) {
      const auto in = legs(s, 1, seed), out = legs(s, 1, 1000 + seed);
      for (const int zone : {0, 1}) {
        EXPECT_LT(worst(by_grid(grid, zone, in, out), exact(s, 0.0, zone, in, out)),
                  0.2 * tolerance + 1e-4)
            << "tolerance " << tolerance << " seed " << seed;
      }
    }
  }
}

TEST_P(PathGridCase, AllPairsAreThere) {
  const Sensor s = sensor();
  const PathGrid grid(s, paths(), 0.0, kBins, 0.0, 0.01);
  const auto in = legs(s, 37, 5), out = legs(s, 11, 6);
  EXPECT_LT(worst(by_grid(grid, 0, in, out), exact(s, 0.0, 0, in, out)), 1e-3);
}

TEST_P(PathGridCase, ExtraPulseWidensIt) {
  const Sensor s = sensor();
  const double variance = std::pow(2 * s.response.core_sigma(), 2);
  const PathGrid grid(s, paths(), variance, kBins, 0.0, 0.01);
  const auto in = legs(s, 3, 7), out = legs(s, 3, 8);
  EXPECT_LT(worst(by_grid(grid, 0, in, out), exact(s, variance, 0, in, out)), 2e-3);
}

// The fit differentiates numerically: the first derivative must not jump from cell to cell.
TEST_P(PathGridCase, DerivativeDoesNotDependOnTheStep) {
  const Sensor s = sensor();
  const PathGrid grid(s, paths(), 0.0, kBins, 0.0, 0.01);
  const auto out = legs(s, 4, 9);
  std::vector<Leg> in = legs(s, 1, 10);
  const double start = in[0].path;
  const auto derivative = [&](double step) {
    in[0].path = start + step;
    std::vector<double> change = by_grid(grid, 0, in, out);
    in[0].path = start - step;
    const std::vector<double> before = by_grid(grid, 0, in, out);
    for (std::size_t k = 0; k < change.size(); ++k)
      change[k] = (change[k] - before[k]) / (2 * step);
    return change;
  };
  const double cell = grid.step();
  const auto fine = derivative(1e-4 * cell), coarse = derivative(3e-2 * cell);
  double error = 0, peak = 0;
  for (std::size_t k = 0; k < fine.size(); ++k) {
    error = std::max(error, std::abs(fine[k] - coarse[k]));
    peak = std::max(peak, std::abs(fine[k]));
  }
  EXPECT_LT(error, 2e-3 * peak);
}

INSTANTIATE_TEST_SUITE_P(Responses, PathGridCase,
                         testing::Combine(testing::Range(std::size_t{0}, cases().size()),
                                          testing::Values(Paths::legs, Paths::whole)),
                         [](const auto& tested) {
                           const bool legs = std::get<1>(tested.param) == Paths::legs;
                           return cases()[std::get<0>(tested.param)].name +
                                  (legs ? "_legs" : "_whole");
                         });

// Counted from the relay, the way out is short by the distance that the sensor measures.
TEST(PathGridTest, LegsMayBeNegative) {
  const Sensor s = sensor_of(cases()[1]);
  for (const Paths paths : {Paths::legs, Paths::whole}) {
    const PathGrid grid(s, paths, 0.0, kBins, 0.7, 0.01);
    const std::vector<Leg> in{{1.2, 1.0}}, out{{-0.69, 1.0}};
    EXPECT_LT(worst(by_grid(grid, 0, in, out), exact(s, 0.0, 0, in, out)), 2e-3);
  }
}

TEST(PathGridTest, BothLegsMayBeNegative) {
  Sensor s = sensor_of(cases()[1]);
  s.zones[0].time_zero = 2 * 0.7 / kSpeedOfLight + 8 * s.bin_width;
  for (const Paths paths : {Paths::legs, Paths::whole}) {
    const PathGrid grid(s, paths, 0.0, kBins, 0.7, 0.01);
    const std::vector<Leg> legs{{-0.69, 1.0}};
    EXPECT_LT(worst(by_grid(grid, 0, legs, legs), exact(s, 0.0, 0, legs, legs)), 2e-3);
  }
}

TEST(PathGridTest, LightBeyondTheAxisIsLeftOutAndLightAtItsEndIsCut) {
  const Sensor s = sensor_of(cases()[1]);
  const double axis = kBins * s.bin_width * kSpeedOfLight;
  for (const Paths paths : {Paths::legs, Paths::whole}) {
    const PathGrid grid(s, paths, 0.0, kBins, 0.0, 0.01);
    for (const double value : by_grid(grid, 0, {{0.6 * axis, 1}}, {{0.6 * axis, 1}})) {
      EXPECT_EQ(value, 0);
    }
    for (const double value : by_grid(grid, 0, {{50 * axis, 1}}, {{0.1, 1}})) EXPECT_EQ(value, 0);
    // The peak in the middle of the last bin.
    const double end = (kBins - 0.5 - 3.37) * s.bin_width * kSpeedOfLight;
    const std::vector<Leg> in{{0.5 * end, 1}}, out{{0.5 * end, 1}};
    EXPECT_LT(worst(by_grid(grid, 0, in, out), exact(s, 0.0, 0, in, out)), 2e-3);
  }
}

TEST(PathGridTest, FinerTolerancesTakeFinerGrids) {
  const Sensor s = sensor_of(cases()[1]);
  double before = 1e9;
  for (const double tolerance : {0.3, 0.01, 1e-4}) {
    const double step = PathGrid(s, Paths::legs, 0.0, kBins, 0.0, tolerance).step();
    EXPECT_LT(step, before);
    before = step;
  }
}

}  // namespace
}  // namespace blindcorner
