// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/pareto_front.h"

#include <algorithm>
#include <cmath>

namespace blindcorner {

std::vector<std::size_t> pareto_front(std::span<const CostAndError> points) {
  const auto finite = [](const CostAndError& p) {
    return std::isfinite(p.cost) && std::isfinite(p.error);
  };
  const auto beats = [](const CostAndError& a, const CostAndError& b) {
    return a.cost <= b.cost && a.error <= b.error && (a.cost < b.cost || a.error < b.error);
  };
  std::vector<std::size_t> front;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool beaten = std::ranges::any_of(points, [&](const CostAndError& other) {
      return finite(other) && beats(other, points[i]);
    });
    if (finite(points[i]) && !beaten) front.push_back(i);
  }
  std::ranges::stable_sort(front, {}, [&](std::size_t i) { return points[i].cost; });
  return front;
}

}  // namespace blindcorner
