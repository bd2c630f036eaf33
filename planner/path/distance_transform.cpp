// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/distance_transform.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

void check_size(const GridGeometry& geometry, std::size_t values) {
  geometry.validate();
  if (values != geometry.cells()) {
    throw Error("distance transform", "found " + std::to_string(values) +
                                          " values, accepted: one per cell, " +
                                          std::to_string(geometry.cells()));
  }
}

/// Lower envelope of parabolas of one width along a line.
class Envelope {
 public:
  void clear() { parabolas_.clear(); }

  /// Adds height + (x - apex)^2. Apexes must come in ascending order.
  void add(double apex, double height) {
    if (height == kNever) return;
    double begin = -kNever;
    while (!parabolas_.empty()) {
      const Parabola& last = parabolas_.back();
      begin = 0.5 * (apex + last.apex + (height - last.height) / (apex - last.apex));
      if (begin > last.begin) break;
      parabolas_.pop_back();
      begin = -kNever;
    }
    parabolas_.push_back({apex, height, begin});
  }

  /// Values at 0, 1, 2, ...; `write(x, value)` for each.
  template <typename Write>
  void evaluate(int count, Write write) const {
    std::size_t k = 0;
    for (int x = 0; x < count; ++x) {
      while (k + 1 < parabolas_.size() && parabolas_[k + 1].begin <= x) ++k;
      const double offset = parabolas_.empty() ? 0 : x - parabolas_[k].apex;
      write(x, parabolas_.empty() ? kNever : parabolas_[k].height + offset * offset);
    }
  }

 private:
  struct Parabola {
    double apex, height;
    double begin;  ///< from where on this one is the lowest
  };
  std::vector<Parabola> parabolas_;
};

/// Squared distances from the nearest obstacle in the same column.
std::vector<double> column_distances(const GridGeometry& geometry,
                                     std::span<const std::uint8_t> obstacle) {
  const auto columns = static_cast<std::size_t>(geometry.columns);
  const std::size_t cells = geometry.cells();
  // First the number of rows down to the nearest obstacle, then the smaller one of down and up.
  std::vector<double> distance(cells);
  for (std::size_t i = 0; i < cells; ++i) {
    distance[i] = obstacle[i] != 0 ? 0 : i < columns ? kNever : distance[i - columns] + 1;
  }
  for (std::size_t i = cells - columns; i-- > 0;) {
    distance[i] = std::min(distance[i], distance[i + columns] + 1);
  }
  for (double& d : distance) {
    const double to_side = std::max(d - 0.5, 0.0);
    d = to_side * to_side;
  }
  return distance;
}

}  // namespace

std::vector<double> lowered_by_parabolas(const GridGeometry& geometry, std::span<const double> f) {
  check_size(geometry, f.size());
  std::vector<double> values(f.begin(), f.end());
  const auto columns = static_cast<std::size_t>(geometry.columns);
  Envelope envelope;
  for (std::size_t row = 0; row < values.size(); row += columns) {
    envelope.clear();
    for (std::size_t x = 0; x < columns; ++x) envelope.add(static_cast<double>(x), values[row + x]);
    envelope.evaluate(geometry.columns, [&](int x, double value) {
      values[row + static_cast<std::size_t>(x)] = value;
    });
  }
  for (std::size_t x = 0; x < columns; ++x) {
    envelope.clear();
    for (int y = 0; y < geometry.rows; ++y) {
      envelope.add(y, values[static_cast<std::size_t>(y) * columns + x]);
    }
    envelope.evaluate(geometry.rows, [&](int y, double value) {
      values[static_cast<std::size_t>(y) * columns + x] = value;
    });
  }
  return values;
}

std::vector<double> squared_distances(const GridGeometry& geometry,
                                      std::span<const std::uint8_t> obstacle) {
  check_size(geometry, obstacle.size());
  std::vector<double> distance = column_distances(geometry, obstacle);
  const auto columns = static_cast<std::size_t>(geometry.columns);
  // The square of cell x reaches from x - 0.5 to x + 0.5, and parabolas stand on these sides.
  // Beyond the other side of its cell a parabola is too high, but there the other side's parabola
  // is lower.
  Envelope envelope;
  for (std::size_t row = 0; row < distance.size(); row += columns) {
    envelope.clear();
    for (std::size_t side = 0; side <= columns; ++side) {
      const double left = side > 0 ? distance[row + side - 1] : kNever;
      const double right = side < columns ? distance[row + side] : kNever;
      envelope.add(static_cast<double>(side) - 0.5, std::min(left, right));
    }
    envelope.evaluate(geometry.columns, [&](int x, double value) {
      double& here = distance[row + static_cast<std::size_t>(x)];
      here = std::min(here, value);
    });
  }
  return distance;
}

}  // namespace blindcorner
