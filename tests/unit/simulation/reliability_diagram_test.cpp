// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/reliability_diagram.h"

#include <gtest/gtest.h>

#include <cmath>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

TEST(ReliabilityDiagram, CountsByProbability) {
  ReliabilityDiagram diagram(4);
  diagram.add(0.1, false);
  diagram.add(0.2, true);
  diagram.add(0.25, true);
  diagram.add(1.0, true);
  const std::vector<ReliabilityBin> bins = diagram.bins();
  ASSERT_EQ(bins.size(), 4U);
  EXPECT_EQ(bins[0].statements, 2);
  EXPECT_EQ(bins[0].happened, 1);
  EXPECT_NEAR(bins[0].mean_predicted, 0.15, 1e-12);
  EXPECT_EQ(bins[0].observed, 0.5);
  EXPECT_EQ(bins[0].interval.low, wilson_interval(1, 2).low);
  EXPECT_EQ(bins[1].statements, 1);
  EXPECT_EQ(bins[2].statements, 0);
  EXPECT_EQ(bins[2].interval.high, 1);
  EXPECT_EQ(bins[3].happened, 1);
}

TEST(ReliabilityDiagram, MergesAndWidens) {
  ReliabilityDiagram a(1), b(1);
  for (int i = 0; i < 100; ++i) (i % 2 == 0 ? a : b).add(0.3, i < 30);
  a.merge(b);
  const ReliabilityBin all = a.bins()[0];
  EXPECT_EQ(all.statements, 100);
  EXPECT_NEAR(all.observed, 0.3, 1e-12);
  const ReliabilityBin few = a.bins(10)[0];
  EXPECT_EQ(few.interval.low, wilson_interval(3, 10).low);
  EXPECT_EQ(few.observed, all.observed);
}

TEST(ReliabilityDiagram, RefusesNonsense) {
  EXPECT_THROW(ReliabilityDiagram(0), Error);
  ReliabilityDiagram diagram(2);
  EXPECT_THROW(diagram.add(1.1, true), Error);
  EXPECT_THROW(diagram.add(std::nan(""), true), Error);
  EXPECT_THROW(diagram.merge(ReliabilityDiagram(3)), Error);
}

}  // namespace
}  // namespace blindcorner
