// SPDX-License-Identifier: Apache-2.0
/// Which of several methods nothing beats in both time and error.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace blindcorner {

struct CostAndError {
  double cost = 0, error = 0;
};

/// Places of those that no other one is better than, by ascending cost: none of the others has a
/// cost and an error that are both at most theirs and one of them smaller. Of equal ones all are
/// there. What is not finite is not.
std::vector<std::size_t> pareto_front(std::span<const CostAndError> points);

}  // namespace blindcorner
