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

TEST(ReliabilityDiagram, BinsHaveEffectiveTrialsOfTheirOwn) {
  ReliabilityDiagram diagram(2);
  for (int i = 0; i < 100; ++i) diagram.add(i < 50 ? 0.3 : 0.7, i % 2 == 0);
  const std::vector<ReliabilityBin> bins = diagram.bins({10, 20});
  EXPECT_EQ(bins[0].interval.low, wilson_interval(5, 10).low);
  EXPECT_EQ(bins[1].interval.low, wilson_interval(10, 20).low);
}

TEST(ReliabilityDiagram, CountsMakeTheSameDiagram) {
  ReliabilityDiagram diagram(3);
  for (int i = 0; i < 10; ++i) diagram.add(0.1 * i, i % 3 == 0);
  const std::vector<ReliabilityBin> there = diagram.bins();
  const std::vector<ReliabilityBin> back = ReliabilityDiagram(diagram.counts()).bins();
  ASSERT_EQ(back.size(), there.size());
  for (std::size_t i = 0; i < back.size(); ++i) {
    EXPECT_EQ(back[i].statements, there[i].statements);
    EXPECT_EQ(back[i].observed, there[i].observed);
    EXPECT_EQ(back[i].mean_predicted, there[i].mean_predicted);
  }
}

TEST(ReliabilityDiagram, RefusesNonsense) {
  EXPECT_THROW(ReliabilityDiagram(0), Error);
  EXPECT_THROW(ReliabilityDiagram(std::vector<ReliabilityCount>{}), Error);
  ReliabilityDiagram diagram(2);
  EXPECT_THROW(diagram.add(1.1, true), Error);
  EXPECT_THROW(diagram.add(std::nan(""), true), Error);
  EXPECT_THROW(diagram.merge(ReliabilityDiagram(3)), Error);
}

}  // namespace
}  // namespace blindcorner
