// SPDX-License-Identifier: Apache-2.0
#include "planner/grid/footprint_kernel.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace blindcorner {
namespace {

using Eigen::Vector2d;

/// Ends of the section in which a horizontal line cuts a convex polygon; `lower` > `upper` if it
/// does not.
struct Section {
  double lower = std::numeric_limits<double>::infinity();
  double upper = -std::numeric_limits<double>::infinity();
};

Section section_at(const Footprint& polygon, double y) {
  Section section;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector2d& a = polygon[i];
    const Vector2d& b = polygon[(i + 1) % polygon.size()];
    if ((a.y() <= y) == (b.y() <= y)) continue;
    const double x = a.x() + (b.x() - a.x()) * (y - a.y()) / (b.y() - a.y());
    section.lower = std::min(section.lower, x);
    section.upper = std::max(section.upper, x);
  }
  return section;
}

/// Adds `weight` times the share of each pixel of a row that [lower, upper] covers. Lengths are in
/// pixels; pixel c reaches from c - 0.5 to c + 0.5.
void add_interval(double lower, double upper, double weight, int row, FootprintKernel& kernel) {
  const int first = static_cast<int>(std::floor(lower + 0.5));
  const int last = static_cast<int>(std::floor(upper + 0.5));
  for (int column = first; column <= last; ++column) {
    const double covered = std::min(upper, column + 0.5) - std::max(lower, column - 0.5);
    if (covered > 0) kernel.at(column, row) += weight * covered;
  }
}

/// Replaces each of `count` values, which lie `stride` apart, by the mean over `width` neighbours.
/// Values outside count as zero.
void average_line(int width, std::size_t count, std::size_t stride, double* values) {
  const auto half = static_cast<std::size_t>(width / 2);
  std::vector<double> sums(count + 1);  // of all values before
  for (std::size_t i = 0; i < count; ++i) sums[i + 1] = sums[i] + values[i * stride];
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t from = i > half ? i - half : 0;
    const std::size_t to = std::min(count, i + half + 1);
    values[i * stride] = (sums[to] - sums[from]) / width;
  }
}

}  // namespace

FootprintKernel empty_kernel(double step, const Vector2d& shift, const Vector2d& lower,
                             const Vector2d& upper, int margin) {
  FootprintKernel kernel;
  kernel.step = step;
  kernel.shift = shift;
  const Vector2d from = (lower + shift) / step;
  const Vector2d to = (upper + shift) / step;
  kernel.first_column = static_cast<int>(std::floor(from.x() + 0.5)) - margin;
  kernel.first_row = static_cast<int>(std::floor(from.y() + 0.5)) - margin;
  kernel.columns = static_cast<int>(std::floor(to.x() + 0.5)) + margin - kernel.first_column + 1;
  kernel.rows = static_cast<int>(std::floor(to.y() + 0.5)) + margin - kernel.first_row + 1;
  kernel.values.assign(
      static_cast<std::size_t>(kernel.columns) * static_cast<std::size_t>(kernel.rows), 0.0);
  return kernel;
}

void add_polygon(const Footprint& polygon, double weight, FootprintKernel& kernel) {
  Footprint pixels;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Vector2d& corner : polygon) {
    pixels.emplace_back((corner + kernel.shift) / kernel.step);
    low = std::min(low, pixels.back().y());
    high = std::max(high, pixels.back().y());
  }
  const int first = static_cast<int>(std::floor(low + 0.5));
  const int last = static_cast<int>(std::floor(high + 0.5));
  for (int row = first; row <= last; ++row) {
    const double from = std::max(low, row - 0.5);
    const double to = std::min(high, row + 0.5);
    if (!(to > from)) continue;
    const Section section = section_at(pixels, (from + to) / 2);
    if (section.lower > section.upper) continue;
    add_interval(section.lower, section.upper, weight * (to - from), row, kernel);
  }
}

void box_average(int width, FootprintKernel& kernel) {
  if (width <= 1) return;
  const auto columns = static_cast<std::size_t>(kernel.columns);
  const auto rows = static_cast<std::size_t>(kernel.rows);
  for (std::size_t row = 0; row < rows; ++row) {
    average_line(width, columns, 1, &kernel.values[row * columns]);
  }
  for (std::size_t column = 0; column < columns; ++column) {
    average_line(width, rows, columns, &kernel.values[column]);
  }
}

Footprint widened(const Footprint& polygon, double side) {
  std::vector<Eigen::Vector3d> corners;
  corners.reserve(4 * polygon.size());
  for (const Vector2d& corner : polygon) {
    for (const double x : {-side / 2, side / 2}) {
      for (const double y : {-side / 2, side / 2}) {
        corners.emplace_back(corner.x() + x, corner.y() + y, 0.0);
      }
    }
  }
  return hull_from_above(corners);
}

}  // namespace blindcorner
