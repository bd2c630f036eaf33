// SPDX-License-Identifier: Apache-2.0
/// Moments along an axis against those of densities with a closed form.
#include "inverse/posterior/along_axis.h"

#include <gtest/gtest.h>

#include <cmath>

namespace blindcorner {
namespace {

TEST(AlongAxis, GaussiansOfAnyWidthAreExact) {
  for (const double ratio : {0.5, 1.0, 4.0}) {
    FallRatios ratios;
    ratios.fill(ratio);
    const AlongAxis along = integrate_along(ratios);
    EXPECT_NEAR(along.mass, 1 / std::sqrt(ratio), 1e-3) << ratio;
    EXPECT_NEAR(along.mean, 0, 1e-12) << ratio;
    EXPECT_NEAR(along.variance, 1 / ratio, 1e-3) << ratio;
  }
}

TEST(AlongAxis, WhatFallsSlowlyOnOneSideHasItsMeanThere) {
  const AlongAxis along = integrate_along({1, 1, 1, 0.3, 0.3});
  EXPECT_GT(along.mean, 0.3);
  EXPECT_GT(along.variance, 1.3);
  EXPECT_GT(along.mass, 1.2);
  const AlongAxis mirrored = integrate_along({0.3, 0.3, 1, 1, 1});
  EXPECT_NEAR(mirrored.mean, -along.mean, 1e-9);
  EXPECT_NEAR(mirrored.variance, along.variance, 1e-9);
}

}  // namespace
}  // namespace blindcorner
