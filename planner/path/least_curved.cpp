// SPDX-License-Identifier: Apache-2.0
#include "planner/path/least_curved.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/cubic_interpolation.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "blindcorner/planner/path/distance_transform.h"
#include "planner/path/spline.h"

namespace blindcorner {
namespace {

/// Weights of what a curve costs.
constexpr double kCurved = 10, kSteered = 10, kTouches = 30, kBent = 0.1, kDrawn = 0.01;
/// Squared length of a derivative, m^2, that is none.
constexpr double kCusp = 1e-12;
/// Share of their limits from which curvature and its rate cost: what is penalised ends a little
/// beyond.
constexpr double kSharpFrom = 0.95;
constexpr int kIterations = 50;
constexpr double kTolerance = 1e-5;
/// Curves are looked at once in so many cells.
constexpr double kPlaceCells = 2;

/// A place on the curve: position and its first three derivatives by the place in a piece, in rows,
/// are shares of four control points, and what is fixed.
struct CurvePlace {
  Eigen::Matrix4d shares;
  Eigen::Matrix<double, 4, 2> fixed = Eigen::Matrix<double, 4, 2>::Zero();
  std::size_t first_point = 0;
};

/// At `t`, 0 to 1, of piece k of the spline of n control points (spline_pieces). It is made from
/// points k - 1 to k + 2; of those beside the ends, which are mirrored there, the shares go to the
/// points that they are mirrored from.
CurvePlace place_at(std::size_t k, double t, std::size_t n, const Eigen::Vector2d& start_bend) {
  const double s = 1 - t;
  CurvePlace place;
  Eigen::Matrix4d& shares = place.shares;
  shares << s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6,
      (-3 * t * t * t + 3 * t * t + 3 * t + 1) / 6, t * t * t / 6,                   // position
      -s * s / 2, (3 * t * t - 4 * t) / 2, (-3 * t * t + 2 * t + 1) / 2, t * t / 2,  // first
      s, 3 * t - 2, 1 - 3 * t, t,                                                    // second
      -1, 3, -3, 1;                                                                  // third
  const Eigen::Matrix4d whole = shares;
  const Eigen::Vector4d nothing = Eigen::Vector4d::Zero();
  if (k == 0) {  // 2 p[0] - p[1] + start_bend, p[0], p[1], p[2]
    shares << whole.col(1) + 2 * whole.col(0), whole.col(2) - whole.col(0), whole.col(3), nothing;
    place.fixed = whole.col(0) * start_bend.transpose();
  } else if (k + 2 == n) {  // p[n-3], p[n-2], p[n-1], 2 p[n-1] - p[n-2]
    shares << nothing, whole.col(0), whole.col(1) - whole.col(3), whole.col(2) + 2 * whole.col(3);
    place.first_point = n - 4;
  } else {
    place.first_point = k - 1;
  }
  return place;
}

using Heights = ceres::Grid2D<double>;
using Interpolated = ceres::BiCubicInterpolator<Heights>;

/// What a place on the curve costs: its curvature and the change of it, and each disc of the
/// footprint.
struct PlaceCost {
  const Interpolated& clearance;
  const GridGeometry& geometry;
  const CurveLimits& limits;
  CurvePlace at;
  double weight;  ///< root of the arc length that the place stands for, in turning radii

  template <typename T>
  bool operator()(const T* a, const T* b, const T* c, const T* d, T* residuals) const {
    using std::sqrt;
    using Vector = Eigen::Matrix<T, 2, 1>;
    const auto row = [&](int order) -> Vector {
      const auto of = [&](int axis) -> T {
        return at.shares(order, 0) * a[axis] + at.shares(order, 1) * b[axis] +
               at.shares(order, 2) * c[axis] + at.shares(order, 3) * d[axis] +
               at.fixed(order, axis);
      };
      return {of(0), of(1)};
    };
    const auto beyond = [](const T& value) -> T { return value > 0.0 ? value : T(0.0); };
    const auto size = [](const T& value) -> T { return value > 0.0 ? value : T(-value); };
    const Vector position = row(0), velocity = row(1), change = row(2), change_of_change = row(3);
    const T speed = sqrt(velocity.squaredNorm() + kCusp);
    const Vector ahead = velocity / speed;
    const auto across = [&](const Vector& v) -> T { return ahead.x() * v.y() - ahead.y() * v.x(); };
    const T curvature = size(across(change)) / (speed * speed);
    residuals[0] = kCurved * weight * beyond(limits.turning_radius * curvature - kSharpFrom);
    // Control points stay nearly evenly spaced: of the curve's third derivative this is most.
    const T rate = size(across(change_of_change)) / (speed * speed * speed);
    residuals[1] = T(0.0);
    if (limits.curvature_rate > 0) {
      residuals[1] = kSteered * weight * beyond(rate / limits.curvature_rate - kSharpFrom);
    }
    T* next = residuals + 2;
    for (const double offset : limits.footprint.disc_offsets()) {
      const Vector place = position + offset * ahead;
      T free;
      clearance.Evaluate((place.y() - geometry.origin.y()) / geometry.cell_size - 0.5,
                         (place.x() - geometry.origin.x()) / geometry.cell_size - 0.5, &free);
      const T lacks = (limits.footprint.disc_radius() + limits.margin - free) / geometry.cell_size;
      *next++ = kTouches * weight * beyond(lacks);
    }
    return true;
  }
};

/// Second difference of three neighbouring control points.
struct BendCost {
  double weight;

  template <typename T>
  bool operator()(const T* a, const T* b, const T* c, T* residuals) const {
    for (int axis = 0; axis < 2; ++axis) {
      residuals[axis] = weight * (a[axis] - 2.0 * b[axis] + c[axis]);
    }
    return true;
  }
};

struct DrawnCost {
  Eigen::Vector2d start;
  double weight;

  template <typename T>
  bool operator()(const T* point, T* residuals) const {
    for (int axis = 0; axis < 2; ++axis) residuals[axis] = weight * (point[axis] - start[axis]);
    return true;
  }
};

}  // namespace

std::vector<double> signed_clearance(const PlanningGrid& grid, double farthest) {
  const GridGeometry& geometry = grid.geometry();
  std::vector<std::uint8_t> free(geometry.cells());
  for (std::size_t i = 0; i < free.size(); ++i) free[i] = grid.obstacle(i) ? 0 : 1;
  std::vector<double> clearance = squared_distances(geometry, free);
  for (std::size_t i = 0; i < clearance.size(); ++i) {
    const double inside = std::sqrt(clearance[i]) * geometry.cell_size;
    clearance[i] =
        free[i] != 0 ? std::min(farthest, grid.clearance(i)) : std::max(-farthest, -inside);
  }
  return clearance;
}

std::vector<Eigen::Vector2d> least_curved(const PlanningGrid& grid,
                                          const std::vector<double>& clearance,
                                          const std::vector<Eigen::Vector2d>& start,
                                          const CurveLimits& limits) {
  const GridGeometry& geometry = grid.geometry();
  const Heights heights(clearance.data(), 0, geometry.rows, 0, geometry.columns);
  const Interpolated interpolated(heights);
  std::vector<Eigen::Vector2d> points = start;
  const std::size_t n = points.size();
  const double spacing = polyline_length(start) / static_cast<double>(n - 1);
  const double radius = limits.turning_radius;

  ceres::Problem problem;
  for (std::size_t i = 0; i < n; ++i) {
    problem.AddParameterBlock(points[i].data(), 2);
    if (i < limits.fixed_first || i + limits.fixed_last >= n) {
      problem.SetParameterBlockConstant(points[i].data());
    }
  }
  const double share = std::sqrt(spacing / radius);
  for (std::size_t i = 0; i < n; ++i) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<DrawnCost, 2, 2>(
                                 new DrawnCost{points[i], kDrawn * share / radius}),
                             nullptr, points[i].data());
    if (i == 0 || i + 1 == n) continue;
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<BendCost, 2, 2, 2, 2>(
                                 new BendCost{kBent * share * radius / (spacing * spacing)}),
                             nullptr, points[i - 1].data(), points[i].data(), points[i + 1].data());
  }
  const auto places =
      std::max(4, static_cast<int>(std::ceil(spacing / (kPlaceCells * geometry.cell_size))));
  const auto residuals = 2 + static_cast<int>(limits.footprint.disc_offsets().size());
  for (std::size_t k = 0; k + 1 < n; ++k) {
    for (int i = 0; i < places; ++i) {
      const CurvePlace at = place_at(k, (i + 0.5) / places, n, limits.start_bend);
      const std::size_t first = at.first_point;
      auto* cost = new PlaceCost{interpolated, geometry, limits, at, share / std::sqrt(places)};
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<PlaceCost, ceres::DYNAMIC, 2, 2, 2, 2>(cost, residuals),
          nullptr, points[first].data(), points[first + 1].data(), points[first + 2].data(),
          points[first + 3].data());
    }
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = kIterations;
  options.function_tolerance = kTolerance;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return points;
}

}  // namespace blindcorner
