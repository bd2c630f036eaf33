// SPDX-License-Identifier: Apache-2.0
/// Finds the methods that no other method beats in both time and error.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace blindcorner {

struct CostAndError {
  double cost = 0, error = 0;
};

/// Indices of the points that no other point beats, by ascending cost. A point beats another if its
/// cost and its error are both at most the other's, and one of them is smaller. All of several
/// equal points are listed. Points that are not finite are left out.
std::vector<std::size_t> pareto_front(std::span<const CostAndError> points);

}  // namespace blindcorner
