// SPDX-License-Identifier: Apache-2.0
#include "planner/grid/object_spread.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "forward/support/multiversion.h"
#include "planner/grid/footprint_kernel.h"

namespace blindcorner {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

/// Smallest standard deviation of a position that is resolved, in cells.
constexpr double kFinest = 0.25;
/// Largest standard deviation of a position that is resolved, in diagonals of the grid. With a
/// larger one the density would be flat over the grid, and at most 1 % of the probability would
/// fall on it.
constexpr double kWidest = 4.0;
/// Least number of position steps across the grid's diagonal.
constexpr double kGridSteps = 8.0;
/// Position step relative to the smallest standard deviation. A sum over a normal density is then
/// exact to 1e-34, and the squares for which its points stand widen it by 1 %.
constexpr double kStep = 0.5;
/// Positions beyond this many standard deviations are left out: 4e-5 of all.
constexpr double kTail = 4.5;
/// Least number of position steps over the search region, whose border is blurred by half a step.
constexpr double kRegionSteps = 24;
/// Least and largest number of steps of yaw or size over their range, at most eight standard
/// deviations.
constexpr int kFewestShapes = 8, kMaxShapes = 96;
/// Weight below which a position, relative to the anchor, or a shape, relative to the sum, is left
/// out.
constexpr double kNegligible = 1e-6;

/// One yaw and size with its weight.
struct ShapeNode {
  Eigen::Vector2d shape = Vector2d::Zero();  ///< yaw (rad), size
  double weight = 1;
};

/// Midpoints of equal steps over a range. The steps are so short that each moves the outline's
/// farthest corner by at most `resolution` (m), if kMaxShapes steps are enough for that.
std::vector<double> steps_over(const ShapeRange& range, double radius, double resolution) {
  const double width = range.upper - range.lower;
  if (!(width * radius > 0.1 * resolution))
    return {std::clamp(range.mean, range.lower, range.upper)};
  const int count = std::clamp(static_cast<int>(std::ceil(width * radius / resolution)),
                               kFewestShapes, kMaxShapes);
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(range.lower + (i + 0.5) * width / count);
  return values;
}

std::vector<ShapeNode> shape_nodes(const ObjectMarginal& marginal, double radius,
                                   double resolution) {
  std::vector<ShapeNode> nodes;
  double total = 0;
  for (const double yaw : steps_over(marginal.yaw, radius, resolution)) {
    for (const double size : steps_over(marginal.size, radius, resolution)) {
      const Vector2d off(yaw - marginal.yaw.mean, size - marginal.size.mean);
      const double weight = std::exp(-0.5 * off.dot(marginal.shape_precision * off));
      nodes.push_back({{yaw, size}, weight});
      total += weight;
    }
  }
  for (ShapeNode& node : nodes) node.weight /= total;
  std::erase_if(nodes, [](const ShapeNode& node) { return node.weight < kNegligible; });
  return nodes;
}

/// Lattice of pixels for positions and footprints. Positions lie `stride` pixels apart, and a cell
/// is `per_cell` pixels wide. One of the two is 1.
struct Lattice {
  double step = 1;  ///< m, of a pixel
  int stride = 1, per_cell = 1;

  double position_step() const { return step * stride; }
};

Lattice lattice_for(double cell_size, double finest_sigma, double coarsest_step) {
  const double wanted = std::min(kStep * finest_sigma, coarsest_step);
  Lattice lattice;
  if (wanted < cell_size) {
    lattice.per_cell = static_cast<int>(std::ceil(cell_size / wanted));
    lattice.step = cell_size / lattice.per_cell;
  } else {
    lattice.stride = (static_cast<int>(wanted / cell_size) - 1) / 2 * 2 + 1;  // odd: symmetric
    lattice.step = cell_size;
  }
  return lattice;
}

double diagonal(const GridGeometry& grid) {
  return grid.cell_size * std::hypot(grid.columns, grid.rows);
}

/// The covariance, with the standard deviation along each axis limited to what is resolved.
Matrix2d resolved(const Matrix2d& covariance, const GridGeometry& grid, double& smallest_sigma) {
  const double finest = kFinest * grid.cell_size;
  const double widest = kWidest * diagonal(grid);
  const Eigen::SelfAdjointEigenSolver<Matrix2d> axes(covariance);
  const Vector2d variance = axes.eigenvalues().cwiseMax(finest * finest).cwiseMin(widest * widest);
  smallest_sigma = std::sqrt(variance.minCoeff());
  return axes.eigenvectors() * variance.asDiagonal() * axes.eigenvectors().transpose();
}

/// Share of the interval [center - half, center + half] within [lower, upper].
double share_within(double center, double half, double lower, double upper) {
  return std::clamp((std::min(center + half, upper) - std::max(center - half, lower)) / (2 * half),
                    0.0, 1.0);
}

/// A lattice point where the object may stand.
struct PositionNode {
  int column = 0, row = 0;  ///< position steps from the anchor
  double weight = 0;
};

/// Positions with their probabilities, which sum to 1.
struct Positions {
  std::vector<PositionNode> nodes;
  Vector2d anchor = Vector2d::Zero();  ///< m, of node (0, 0)
};

/// First and last position step from the anchor that positions can have along an axis.
std::pair<int, int> steps_along(double mean, double sigma, double lower, double upper,
                                double anchor, double step) {
  const double from = std::max(mean - kTail * sigma, lower);
  const double to = std::min(mean + kTail * sigma, upper);
  return {static_cast<int>(std::floor((from - anchor) / step)),
          static_cast<int>(std::ceil((to - anchor) / step))};
}

Positions positions_of(const ObjectMarginal& marginal, const Matrix2d& covariance, double step) {
  Positions positions;
  positions.anchor = marginal.position.cwiseMax(marginal.lower).cwiseMin(marginal.upper);
  const Matrix2d precision = covariance.inverse();
  const auto [left, right] =
      steps_along(marginal.position.x(), std::sqrt(covariance(0, 0)), marginal.lower.x(),
                  marginal.upper.x(), positions.anchor.x(), step);
  const auto [bottom, top] =
      steps_along(marginal.position.y(), std::sqrt(covariance(1, 1)), marginal.lower.y(),
                  marginal.upper.y(), positions.anchor.y(), step);
  // Weights are relative to the density at the anchor, which may lie far from the mean where the
  // prior cuts the density off.
  const Vector2d origin = positions.anchor - marginal.position;
  const double reference = origin.dot(precision * origin);
  double total = 0;
  for (int row = bottom; row <= top; ++row) {
    for (int column = left; column <= right; ++column) {
      const Vector2d place = positions.anchor + step * Vector2d(column, row);
      const double within =
          share_within(place.x(), step / 2, marginal.lower.x(), marginal.upper.x()) *
          share_within(place.y(), step / 2, marginal.lower.y(), marginal.upper.y());
      const Vector2d off = place - marginal.position;
      const double weight = within * std::exp(-0.5 * (off.dot(precision * off) - reference));
      if (!(weight > kNegligible)) continue;
      total += weight;
      positions.nodes.push_back({column, row, weight});
    }
  }
  if (positions.nodes.empty()) {  // a search region much narrower than a cell
    positions.nodes.push_back({0, 0, 1});
    return positions;
  }
  for (PositionNode& node : positions.nodes) node.weight /= total;
  return positions;
}

/// Sum of the footprints of all shapes, with their weights. Each footprint is moved by the shift of
/// the position's mean for its shape.
struct ShapeKernels {
  FootprintKernel touched;  ///< share of the shapes that touch a cell
  FootprintKernel covered;  ///< share that covers its centre; of the same extent
};

ShapeKernels draw_shapes(const std::vector<ShapeNode>& nodes, const ObjectMarginal& marginal,
                         const GroundObject& object, const Lattice& lattice, double cell_size,
                         const Vector2d& shift) {
  const Vector2d mean(marginal.yaw.mean, marginal.size.mean);
  std::vector<Footprint> bodies, reaches;
  Vector2d lower = Vector2d::Zero();
  Vector2d upper = Vector2d::Zero();
  for (const ShapeNode& node : nodes) {
    const Vector2d moved = marginal.slope * (node.shape - mean);
    const Matrix2d turn = node.shape[1] * Eigen::Rotation2Dd(node.shape[0]).toRotationMatrix();
    Footprint corners;
    for (const Vector2d& corner : object.outline) corners.emplace_back(moved + turn * corner);
    reaches.push_back(widened(corners, cell_size));
    bodies.push_back(std::move(corners));
    for (const Vector2d& corner : reaches.back()) {
      lower = lower.cwiseMin(corner);
      upper = upper.cwiseMax(corner);
    }
  }
  ShapeKernels kernels;
  kernels.touched = empty_kernel(lattice.step, shift, lower, upper, lattice.stride / 2 + 1);
  kernels.covered = kernels.touched;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    add_polygon(reaches[i], nodes[i].weight, kernels.touched);
    add_polygon(bodies[i], nodes[i].weight, kernels.covered);
  }
  box_average(lattice.stride, kernels.touched);
  box_average(lattice.stride, kernels.covered);
  return kernels;
}

/// A kernel split into tables with one value per cell: every `per_cell`-th value along both axes,
/// one table for each pixel to begin at.
struct KernelPhases {
  struct Table {
    int first_column = 0, first_row = 0;  ///< in cells
    int columns = 0, rows = 0;
    std::vector<double> values;
  };
  int per_cell = 1;
  std::vector<Table> tables;  ///< [per_cell, per_cell] by row and column modulo `per_cell`
};

int floor_divide(int a, int b) { return a >= 0 ? a / b : -((-a + b - 1) / b); }

KernelPhases phases_of(FootprintKernel& kernel, int per_cell) {
  KernelPhases phases;
  phases.per_cell = per_cell;
  const auto first = [&](int begin, int phase) {
    return floor_divide(begin - phase + per_cell - 1, per_cell);
  };
  for (int y = 0; y < per_cell; ++y) {
    for (int x = 0; x < per_cell; ++x) {
      KernelPhases::Table table;
      table.first_column = first(kernel.first_column, x);
      table.first_row = first(kernel.first_row, y);
      table.columns = first(kernel.first_column + kernel.columns, x) - table.first_column;
      table.rows = first(kernel.first_row + kernel.rows, y) - table.first_row;
      for (int row = 0; row < table.rows; ++row) {
        for (int column = 0; column < table.columns; ++column) {
          table.values.push_back(kernel.at((table.first_column + column) * per_cell + x,
                                           (table.first_row + row) * per_cell + y));
        }
      }
      phases.tables.push_back(std::move(table));
    }
  }
  return phases;
}

/// The cells that a table, placed on the grid, shares with a rectangle of cells.
struct Overlap {
  int columns = 0, rows = 0;
  std::ptrdiff_t in_table = 0, in_cells = 0;  ///< where the first of them is stored
};

Overlap overlap_of(const KernelPhases::Table& table, const Cell& put, int first_column,
                   int first_row, int columns, int rows) {
  const int left = std::max(put.column + table.first_column, first_column);
  const int bottom = std::max(put.row + table.first_row, first_row);
  const int right =
      std::min(put.column + table.first_column + table.columns, first_column + columns);
  const int top = std::min(put.row + table.first_row + table.rows, first_row + rows);
  if (left >= right || bottom >= top) return {};
  return {right - left, top - bottom,
          static_cast<std::ptrdiff_t>(bottom - put.row - table.first_row) * table.columns +
              (left - put.column - table.first_column),
          static_cast<std::ptrdiff_t>(bottom - first_row) * columns + (left - first_column)};
}

/// Adds `weight` times a table to a window.
BLINDCORNER_MULTIVERSION
void add_table(const double* table, int table_columns, double weight, int columns, int rows,
               double* window, int window_columns) {
  for (int row = 0; row < rows; ++row) {
    const double* from = table + static_cast<std::ptrdiff_t>(row) * table_columns;
    double* to = window + static_cast<std::ptrdiff_t>(row) * window_columns;
    BLINDCORNER_INDEPENDENT
    for (int column = 0; column < columns; ++column) to[column] += weight * from[column];
  }
}

/// Adds one row of an object's footprint at a position where part of it has been seen. In each cell
/// the smaller of two bounds counts: `unseen` for the whole position, and what was seen in the
/// cell.
BLINDCORNER_MULTIVERSION
void add_unseen_row(const double* touched, const double* covered, const double* not_seen,
                    double weight, double unseen, int columns, double* to) {
  BLINDCORNER_INDEPENDENT
  for (int column = 0; column < columns; ++column) {
    const double place = unseen * touched[column];
    const double shapes = touched[column] - (1 - not_seen[column]) * covered[column];
    to[column] += weight * (place < shapes ? place : shapes);
  }
}

/// Places footprints at positions, and leaves out what has been seen of them.
class Placer {
 public:
  Placer(ShapeKernels& kernels, const Lattice& lattice, const GridGeometry& grid,
         std::span<const double> not_seen)
      : touched_(phases_of(kernels.touched, lattice.per_cell)),
        covered_(phases_of(kernels.covered, lattice.per_cell)),
        stride_(lattice.stride),
        grid_(grid),
        not_seen_(not_seen) {}

  /// Adds the object at a position to the window: in each cell, the probability that the object
  /// stands at the position, occupies the cell and has not been seen. Returns the probability that
  /// it stands there unseen.
  double place(const PositionNode& node, const Cell& anchor_cell, const Cell& stands_in,
               Window& window) const {
    // Relative to the node, cell c is pixel (c - anchor) * per_cell - steps * stride.
    const int n = touched_.per_cell;
    const int x = node.column * stride_;
    const int y = node.row * stride_;
    const int phase_x = -x - n * floor_divide(-x, n);
    const int phase_y = -y - n * floor_divide(-y, n);
    const auto phase = static_cast<std::size_t>(phase_y * n + phase_x);
    const Cell put{anchor_cell.column + floor_divide(x + phase_x, n),
                   anchor_cell.row + floor_divide(y + phase_y, n)};
    const double unseen = not_seen_.empty() ? 1.0 : unseen_at(phase, put, stands_in);
    add(phase, put, node.weight, unseen, window);
    return node.weight * unseen;
  }

 private:
  /// Probability that an object at a position has not been seen. A ray either ends on the object or
  /// passes the place. The cells that one footprint covers are therefore no further evidence for
  /// each other, and the cell that says most against the object counts.
  double unseen_at(std::size_t phase, const Cell& put, const Cell& stands_in) const {
    double seen = grid_.contains(stands_in) ? 1 - not_seen_[grid_.index(stands_in)] : 0.0;
    const KernelPhases::Table& table = covered_.tables[phase];
    const Overlap overlap = overlap_of(table, put, 0, 0, grid_.columns, grid_.rows);
    for (int row = 0; row < overlap.rows; ++row) {
      const double* share =
          table.values.data() + overlap.in_table + static_cast<std::ptrdiff_t>(row) * table.columns;
      const double* cells =
          not_seen_.data() + overlap.in_cells + static_cast<std::ptrdiff_t>(row) * grid_.columns;
      for (int column = 0; column < overlap.columns; ++column) {
        seen = std::max(seen, share[column] * (1 - cells[column]));
      }
    }
    return 1 - std::min(1.0, seen);
  }

  void add(std::size_t phase, const Cell& put, double weight, double unseen, Window& window) const {
    const KernelPhases::Table& table = touched_.tables[phase];
    const Overlap overlap =
        overlap_of(table, put, window.first_column, window.first_row, window.columns, window.rows);
    if (overlap.rows == 0) return;
    double* to = window.values.data() + overlap.in_cells;
    const double* touched = table.values.data() + overlap.in_table;
    if (unseen == 1) {
      add_table(touched, table.columns, weight, overlap.columns, overlap.rows, to, window.columns);
      return;
    }
    const double* covered = covered_.tables[phase].values.data() + overlap.in_table;
    const std::ptrdiff_t first = overlap.in_cells / window.columns + window.first_row;
    const std::ptrdiff_t column = overlap.in_cells % window.columns + window.first_column;
    const double* cells = not_seen_.data() + first * grid_.columns + column;
    for (std::ptrdiff_t row = 0; row < overlap.rows; ++row) {
      add_unseen_row(touched + row * table.columns, covered + row * table.columns,
                     cells + row * grid_.columns, weight, unseen, overlap.columns,
                     to + row * window.columns);
    }
  }

  KernelPhases touched_, covered_;
  int stride_ = 1;
  const GridGeometry& grid_;
  std::span<const double> not_seen_;
};

/// The part of the grid that an object at these positions can reach.
Window window_for(const Positions& positions, const Cell& anchor_cell, const Lattice& lattice,
                  const FootprintKernel& kernel, const GridGeometry& grid) {
  int left = 0, right = -1, bottom = 0, top = -1;
  if (!positions.nodes.empty()) {
    const auto columns = std::ranges::minmax(positions.nodes, {}, &PositionNode::column);
    const auto rows = std::ranges::minmax(positions.nodes, {}, &PositionNode::row);
    const auto cells = [&](int steps, int pixels) {
      return floor_divide(steps * lattice.stride + pixels, lattice.per_cell);
    };
    left = anchor_cell.column + cells(columns.min.column, kernel.first_column);
    right = anchor_cell.column + cells(columns.max.column, kernel.first_column + kernel.columns);
    bottom = anchor_cell.row + cells(rows.min.row, kernel.first_row);
    top = anchor_cell.row + cells(rows.max.row, kernel.first_row + kernel.rows);
  }
  Window window;
  window.first_column = std::clamp(left, 0, grid.columns);
  window.first_row = std::clamp(bottom, 0, grid.rows);
  window.columns = std::clamp(right + 1, 0, grid.columns) - window.first_column;
  window.rows = std::clamp(top + 1, 0, grid.rows) - window.first_row;
  window.values.assign(
      static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows), 0.0);
  return window;
}

/// Whether the object touches the grid at none of the positions that it may have.
bool out_of_reach(const ObjectMarginal& marginal, const Matrix2d& covariance,
                  const GroundObject& object, const GridGeometry& grid) {
  const Vector2d center = grid.origin + grid.cell_size / 2 * Vector2d(grid.columns, grid.rows);
  const double reach =
      kTail * std::sqrt(covariance.trace()) + diagonal(grid) + object.radius * marginal.size.upper +
      (marginal.slope.cwiseAbs() *
       Vector2d(marginal.yaw.upper - marginal.yaw.lower, marginal.size.upper - marginal.size.lower))
          .norm();
  return !((marginal.position - center).norm() <= reach);
}

}  // namespace

ObjectSpread spread(const ObjectMarginal& marginal, const GroundObject& object,
                    const GridGeometry& grid, std::span<const double> not_seen) {
  double sigma = 0;
  const Matrix2d covariance = resolved(marginal.covariance, grid, sigma);
  if (out_of_reach(marginal, covariance, object, grid)) return {};
  double coarsest = std::min((marginal.upper - marginal.lower).minCoeff() / kRegionSteps,
                             diagonal(grid) / kGridSteps);
  // The borders of what was seen matter on the scale of the object.
  if (!not_seen.empty()) coarsest = std::min(coarsest, object.radius / 2);
  const Lattice lattice = lattice_for(grid.cell_size, sigma, std::max(coarsest, grid.cell_size));
  const Positions positions = positions_of(marginal, covariance, lattice.position_step());

  // A kernel's pixels stand for the centres of cells relative to the anchor.
  const Cell anchor_cell = grid.cell_at(positions.anchor);
  const Vector2d shift = positions.anchor - grid.center(anchor_cell);
  const auto nodes = shape_nodes(marginal, object.radius, sigma);
  ShapeKernels kernels = draw_shapes(nodes, marginal, object, lattice, grid.cell_size, shift);
  const Placer placer(kernels, lattice, grid, not_seen);

  ObjectSpread result{window_for(positions, anchor_cell, lattice, kernels.touched, grid), 0.0};
  for (const PositionNode& node : positions.nodes) {
    const Vector2d place =
        positions.anchor + lattice.position_step() * Vector2d(node.column, node.row);
    result.not_seen += placer.place(node, anchor_cell, grid.cell_at(place), result.window);
  }
  return result;
}

}  // namespace blindcorner
