// SPDX-License-Identifier: Apache-2.0
#include "forward/transport/pair_sum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "unit/test_scenes.h"

namespace blindcorner {
namespace {

using namespace testing_scenes;

/// Legs in a cone of directions about +x, with lengths of `from` to `to` m.
std::vector<Leg> scattered_legs(int count, double spread, double from, double to, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> even(0, 1);
  std::vector<Leg> legs;
  for (int i = 0; i < count; ++i) {
    Leg leg;
    leg.weight = 0.1 + even(random);
    leg.length = from + (to - from) * even(random);
    leg.direction =
        Vector3d(1, spread * (even(random) - 0.5), spread * (even(random) - 0.5)).normalized();
    leg.cosine = leg.direction.x();
    legs.push_back(leg);
  }
  return legs;
}

HistogramCube finished(const PairSum& sum, const Sensor& sensor) {
  HistogramCube cube(sensor.rows, sensor.columns, sensor.bins);
  sum.finish(cube);
  return cube;
}

// Runs, tables and series change nothing: each pair alone gives the same light.
TEST(PairSum, RetroreflectivePairsAreSummedAsWrittenOut) {
  const Sensor sensor = one_narrow_zone().sensor;
  const double sigma = 1.5 * kDegree;
  const auto in = scattered_legs(301, 0.6, 0.3, 0.7, 1);
  const auto out = scattered_legs(45, 0.6, 0.3, 0.7, 2);
  PairSum pairs(sensor);
  pairs.add_retroreflective(0, 2e-3, 0.8, sigma, in, out);
  PairSum plain(sensor);
  for (const Leg& r : out) {
    for (const Leg& p : in) {
      const double chord = (p.direction - r.direction).norm();
      const double lobe =
          std::exp(-0.5 * chord * chord / (sigma * sigma)) / (2 * kPi * sigma * sigma);
      plain.add(0, 2e-3 * 0.8 * lobe * p.weight * r.weight * std::sqrt(p.cosine * r.cosine),
                p.length + r.length);
    }
  }
  const HistogramCube got = finished(pairs, sensor);
  const HistogramCube want = finished(plain, sensor);
  ASSERT_GT(sum(want), 0);
  EXPECT_LT(difference(got, want), 1e-4);  // lobes end at 4.5 sigma: 4e-5 of their light
}

// Paths beyond the time axis are dropped; their neighbours in the same run stay.
TEST(PairSum, RunsThatLeaveTheTimeAxisKeepWhatIsOnIt) {
  const Sensor sensor = one_narrow_zone().sensor;
  const double end = kSpeedOfLight * sensor.bin_width * sensor.bins;
  auto in = scattered_legs(64, 0.01, 0.2, 0.3, 3);
  const auto out = scattered_legs(8, 0.01, 0.2, 0.3, 4);
  PairSum within(sensor);
  within.add_retroreflective(0, 1.0, 0.5, 0.02, in, out);
  std::vector<Leg> more;
  for (const Leg& leg : in) {
    more.push_back(leg);
    more.push_back(leg);
    more.back().length = 100 * end;
    more.push_back(leg);
    more.back().length = -100 * end;
  }
  PairSum beyond(sensor);
  beyond.add_retroreflective(0, 1.0, 0.5, 0.02, more, out);
  EXPECT_LT(difference(finished(beyond, sensor), finished(within, sensor)), 1e-12);
  EXPECT_GT(sum(finished(within, sensor)), 0);
}

}  // namespace
}  // namespace blindcorner
