// SPDX-License-Identifier: Apache-2.0
#include "inverse/posterior/prior_moments.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "blindcorner/forward/constants.h"

namespace blindcorner {
namespace {

PriorMoments moments_of(const Unknown& unknown) {
  Scene scene;
  scene.unknowns = {unknown};
  return prior_moments(scene, 0);
}

TEST(PriorMoments, AreThoseOfTheEvenRangeWithoutANormalPrior) {
  const PriorMoments even = moments_of({Component::x, -1, 7, std::nullopt});
  EXPECT_DOUBLE_EQ(even.mean, 3);
  EXPECT_DOUBLE_EQ(even.variance, 64.0 / 12);
}

// Closed forms: a normal density that the range does not cut (however narrow beside it), and half
// of one, mean sigma sqrt(2 / pi) and variance sigma^2 (1 - 2 / pi).
TEST(PriorMoments, AreThoseOfTheNormalPriorThatTheRangeLeaves) {
  for (const double sigma : {1e-4, 0.1, 1.0}) {
    const PriorMoments whole = moments_of({Component::x, -100, 100, NormalPrior{20, sigma}});
    EXPECT_NEAR(whole.mean, 20, 1e-9);
    EXPECT_NEAR(whole.variance / (sigma * sigma), 1, 1e-9);
    const PriorMoments half = moments_of({Component::x, 20, 100, NormalPrior{20, sigma}});
    EXPECT_NEAR((half.mean - 20) / sigma, std::sqrt(2 / std::numbers::pi), 1e-3);
    EXPECT_NEAR(half.variance / (sigma * sigma), 1 - 2 / std::numbers::pi, 1e-3);
  }
  const PriorMoments wide = moments_of({Component::x, -1, 7, NormalPrior{3, 1e4}});
  EXPECT_NEAR(wide.variance, 64.0 / 12, 1e-4);
  const PriorMoments elsewhere = moments_of({Component::x, -1, 7, NormalPrior{300, 1}});
  EXPECT_DOUBLE_EQ(elsewhere.variance, 64.0 / 12);
}

// A box looks the same after half a turn.
TEST(PriorMoments, OfACircleAreThoseOfOnePeriod) {
  Scene scene;
  scene.hidden.shape = BoxShape{{0.2, 0.5, 0.9}};
  scene.unknowns = {{Component::yaw, 0, 2 * kPi, std::nullopt}};
  EXPECT_NEAR(prior_moments(scene, 0).variance, kPi * kPi / 12, 1e-12);
}

}  // namespace
}  // namespace blindcorner
