// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/grid/pose_hypotheses.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "blindcorner/planner/grid/pose_spread.h"
#include "planner/grid/footprint_kernel.h"
#include "planner/grid/object_marginal.h"
#include "planner/grid/spread_points.h"

namespace blindcorner {
namespace {

using Eigen::Vector2d;

/// Number of poses of an object, shared among its modes in proportion to their weights, and least
/// number for a mode.
constexpr double kPoses = 2048;
constexpr int kFewestPoses = 64;
/// A search region narrower than this many standard deviations is sampled evenly and weighted: more
/// than half of normally distributed points would lie outside it.
constexpr double kNarrowRegion = 2;

/// Ratio of spread_point() in four dimensions: x^5 = x + 1.
constexpr double kRatio = 1.1673039782614187;

/// A pose with its unnormalised weight.
struct SampledPose {
  Vector2d position = Vector2d::Zero();  ///< m
  double yaw = 0, size = 1, weight = 0;
};

double between(const ShapeRange& range, double share) {
  return range.lower < range.upper ? range.lower + share * (range.upper - range.lower)
                                   : std::clamp(range.mean, range.lower, range.upper);
}

/// Points of a marginal; weights sum to 1.
std::vector<SampledPose> sample(const ObjectMarginal& marginal, int count) {
  const double widest = std::sqrt(
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(marginal.covariance).eigenvalues().maxCoeff());
  const Vector2d region = marginal.upper - marginal.lower;
  const bool evenly = region.maxCoeff() < kNarrowRegion * widest;
  const Eigen::LLT<Eigen::Matrix2d> factor(marginal.covariance);
  std::vector<SampledPose> poses;
  double total = 0;
  for (int i = 0; i < count; ++i) {
    const auto u = spread_point<4>(i, kRatio);
    SampledPose pose;
    pose.yaw = between(marginal.yaw, u[2]);
    pose.size = between(marginal.size, u[3]);
    const Vector2d shape(pose.yaw - marginal.yaw.mean, pose.size - marginal.size.mean);
    pose.weight = std::exp(-0.5 * shape.dot(marginal.shape_precision * shape));
    const Vector2d mean = marginal.position + marginal.slope * shape;
    if (evenly) {
      pose.position = marginal.lower + region.cwiseProduct(Vector2d(u[0], u[1]));
      const Vector2d off = pose.position - mean;
      pose.weight *= std::exp(-0.5 * off.dot(factor.solve(off)));
    } else {
      pose.position = mean + factor.matrixL() * normal_point(u[0], u[1]);
      const bool inside = (pose.position.array() >= marginal.lower.array()).all() &&
                          (pose.position.array() <= marginal.upper.array()).all();
      if (!inside) pose.weight = 0;
    }
    if (!(pose.weight > 0)) continue;
    total += pose.weight;
    poses.push_back(pose);
  }
  if (poses.empty()) poses.push_back({marginal.position, marginal.yaw.mean, marginal.size.mean, 1});
  for (SampledPose& pose : poses) pose.weight /= total > 0 ? total : 1;
  return poses;
}

bool inside(const Footprint& polygon, const Vector2d& point) {
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector2d edge = polygon[(i + 1) % polygon.size()] - polygon[i];
    const Vector2d off = point - polygon[i];
    if (edge.x() * off.y() - edge.y() * off.x() < 0) return false;
  }
  return true;
}

/// The cells that an object at a pose covers and touches.
PoseHypothesis drawn(const SampledPose& pose, const GroundObject& object,
                     const GridGeometry& grid) {
  const Eigen::Matrix2d turn = pose.size * Eigen::Rotation2Dd(pose.yaw).toRotationMatrix();
  Footprint body;
  for (const Vector2d& corner : object.outline) body.emplace_back(pose.position + turn * corner);
  const Footprint reach = widened(body, grid.cell_size);
  Eigen::AlignedBox2d box;
  for (const Vector2d& corner : reach) box.extend(corner);
  PoseHypothesis hypothesis;
  for (const Cell& cell : grid.cells_in(box)) {
    const Vector2d center = grid.center(cell);
    if (!inside(reach, center)) continue;
    hypothesis.touches.push_back(grid.index(cell));
    if (inside(body, center)) hypothesis.covers.push_back(grid.index(cell));
  }
  return hypothesis;
}

}  // namespace

struct PoseHypotheses::Impl {
  Impl(const Scene& scene, const GridGeometry& geometry)
      : grid(geometry), unknowns(scene.unknowns), check(scene, geometry) {
    for (int i = 0; i < object_count(scene); ++i) objects.emplace_back(scene, i);
  }

  void add_mode(const PoseMode& mode, const GroundObject& object, std::span<const double> not_seen,
                std::vector<PoseHypothesis>& hypotheses) const;
  std::vector<PoseHypothesis> of(const PoseMixture& mixture, const GroundObject& object,
                                 std::span<const double> not_seen) const;

  GridGeometry grid;
  std::vector<Unknown> unknowns;
  std::vector<GroundObject> objects;
  PoseSpread check;
};

void PoseHypotheses::Impl::add_mode(const PoseMode& mode, const GroundObject& object,
                                    std::span<const double> not_seen,
                                    std::vector<PoseHypothesis>& hypotheses) const {
  if (is_absent(mode, object) || !(mode.weight > 0)) return;
  const int count = std::max(kFewestPoses, static_cast<int>(std::ceil(kPoses * mode.weight)));
  for (const SampledPose& pose : sample(marginal_of(mode, unknowns, object), count)) {
    PoseHypothesis hypothesis = drawn(pose, object, grid);
    double unseen = 1;
    if (!not_seen.empty()) {
      for (const std::size_t cell : hypothesis.covers) unseen = std::min(unseen, not_seen[cell]);
    }
    hypothesis.probability = mode.weight * pose.weight * unseen;
    hypotheses.push_back(std::move(hypothesis));
  }
}

std::vector<PoseHypothesis> PoseHypotheses::Impl::of(const PoseMixture& mixture,
                                                     const GroundObject& object,
                                                     std::span<const double> not_seen) const {
  std::vector<PoseHypothesis> hypotheses;
  for (const PoseMode& mode : with_prior(mixture, unknowns)) {
    add_mode(mode, object, not_seen, hypotheses);
  }
  // Bayes: present and unseen, against absent.
  double unseen = 0;
  for (const PoseHypothesis& hypothesis : hypotheses) unseen += hypothesis.probability;
  const double presence = mixture.presence_probability;
  const double evidence = presence * unseen + (1 - presence);
  for (PoseHypothesis& hypothesis : hypotheses) {
    hypothesis.probability *= evidence > 0 ? presence / evidence : 0;
  }
  return hypotheses;
}

PoseHypotheses::PoseHypotheses(const Scene& scene, const GridGeometry& grid)
    : impl_(std::make_shared<const Impl>(scene, grid)) {}

std::vector<PoseHypothesis> PoseHypotheses::of(const PoseMixture& mixture,
                                               std::span<const double> not_seen) const {
  impl_->check.check(mixture);
  check_not_seen(not_seen, impl_->grid);
  std::vector<PoseHypothesis> all;
  if (mixture.presence_probability == 0) return all;
  for (const GroundObject& object : impl_->objects) {
    std::ranges::move(impl_->of(mixture, object, not_seen), std::back_inserter(all));
  }
  return all;
}

}  // namespace blindcorner
