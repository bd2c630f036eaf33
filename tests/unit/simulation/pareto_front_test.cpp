// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/pareto_front.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace blindcorner {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(ParetoFront, HoldsWhatNothingBeatsByAscendingCost) {
  const std::vector<CostAndError> points{{4, 1}, {1, 4}, {2, 2}, {3, 3}, {2, 5}};
  EXPECT_THAT(pareto_front(points), ElementsAre(1, 2, 0));
}

// Of two with the same error the cheaper one is there, of two that are equal both.
TEST(ParetoFront, OfEqualErrorsTakesTheCheapest) {
  EXPECT_THAT(pareto_front(std::vector<CostAndError>{{2, 1}, {1, 1}}), ElementsAre(1));
  EXPECT_THAT(pareto_front(std::vector<CostAndError>{{1, 1}, {1, 1}}), ElementsAre(0, 1));
}

TEST(ParetoFront, LeavesOutWhatIsNotFinite) {
  const std::vector<CostAndError> points{{std::nan(""), 0}, {0, INFINITY}, {1, 1}};
  EXPECT_THAT(pareto_front(points), ElementsAre(2));
  EXPECT_THAT(pareto_front({}), IsEmpty());
}

}  // namespace
}  // namespace blindcorner
