// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/bezier.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace blindcorner {
namespace {

/// Lengths below this share of the curve's extent are rounding errors of its control points.
constexpr double kRounding = 1e-12;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Largest distance of a control point from the first one, m.
double extent(const CubicBezier& curve) {
  double most = 0;
  for (const Eigen::Vector2d& point : curve.control) {
    most = std::max(most, (point - curve.control[0]).norm());
  }
  return most;
}

/// The same for all t, m.
Eigen::Vector2d third_derivative(const CubicBezier& curve) {
  const auto& p = curve.control;
  return 6 * (p[3] - p[0] + 3 * (p[1] - p[2]));
}

/// Gauss-Legendre quadrature of the speed with five points (Abramowitz & Stegun, table 25.4).
double quadrature(const CubicBezier& curve, double from, double to) {
  constexpr std::array<double, 3> kNodes{0, 0.5384693101056831, 0.9061798459386640};
  constexpr std::array<double, 3> kWeights{0.5688888888888889, 0.4786286704993665,
                                           0.2369268850561891};
  const double center = 0.5 * (from + to), half = 0.5 * (to - from);
  double sum = kWeights[0] * curve.derivative(center).norm();
  for (std::size_t k = 1; k < kNodes.size(); ++k) {
    sum += kWeights[k] * (curve.derivative(center - half * kNodes[k]).norm() +
                          curve.derivative(center + half * kNodes[k]).norm());
  }
  return half * sum;
}

double refined(const CubicBezier& curve, double from, double to, double whole, double tolerance,
               int halvings) {
  const double middle = 0.5 * (from + to);
  const double left = quadrature(curve, from, middle), right = quadrature(curve, middle, to);
  if (halvings == 0 || std::abs(left + right - whole) <= tolerance) return left + right;
  return refined(curve, from, middle, left, tolerance, halvings - 1) +
         refined(curve, middle, to, right, tolerance, halvings - 1);
}

}  // namespace

Eigen::Vector2d CubicBezier::point(double t) const {
  const double s = 1 - t;
  return s * s * s * control[0] + 3 * s * s * t * control[1] + 3 * s * t * t * control[2] +
         t * t * t * control[3];
}

Eigen::Vector2d CubicBezier::derivative(double t) const {
  const double s = 1 - t;
  return 3 * (s * s * (control[1] - control[0]) + 2 * s * t * (control[2] - control[1]) +
              t * t * (control[3] - control[2]));
}

Eigen::Vector2d CubicBezier::second_derivative(double t) const {
  return 6 * ((1 - t) * (control[2] - 2 * control[1] + control[0]) +
              t * (control[3] - 2 * control[2] + control[1]));
}

double CubicBezier::heading(double t) const {
  const double smallest = kRounding * extent(*this);
  Eigen::Vector2d direction = derivative(t);
  if (direction.norm() <= smallest) {
    direction = t < 1 ? second_derivative(t) : Eigen::Vector2d(-second_derivative(t));
  }
  if (direction.norm() <= smallest) direction = third_derivative(*this);
  return direction.norm() <= smallest ? 0 : std::atan2(direction.y(), direction.x());
}

double CubicBezier::curvature(double t) const {
  const double size = extent(*this);
  if (size == 0) return 0;
  const Eigen::Vector2d velocity = derivative(t), change = second_derivative(t);
  const double speed = velocity.norm();
  if (speed > kRounding * size) return cross(velocity, change) / (speed * speed * speed);
  // Near such a t the curvature is change x third derivative / (2 |change|^3 (t - here)).
  const double turn = cross(change, third_derivative(*this));
  if (std::abs(turn) <= kRounding * size * size) return 0;
  return std::copysign(std::numeric_limits<double>::infinity(), t < 1 ? turn : -turn);
}

double CubicBezier::length(double from, double to) const {
  constexpr double kTolerance = 1e-9;  // of the control polygon's length
  constexpr int kHalvings = 20;        // a cusp's piece has then 1e-6 of the curve's length
  double polygon = 0;
  for (std::size_t i = 1; i < control.size(); ++i) {
    polygon += (control[i] - control[i - 1]).norm();
  }
  return refined(*this, from, to, quadrature(*this, from, to), kTolerance * polygon, kHalvings);
}

}  // namespace blindcorner
