// SPDX-License-Identifier: Apache-2.0
#include "planner/grid/object_marginal.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

/// Standard deviation given to an exactly known value, m, rad or 1, so that matrices stay regular.
constexpr double kExact = 1e-6;
/// Share of the prior's precision that is taken out of undetermined unknowns. The rest leaves a
/// standard deviation of seven times the prior's, twice its range: flat to 3 % over that range.
constexpr double kTakenOut = 0.98;
/// Values farther from the mean than this many standard deviations are left out: 6e-5 of a normal
/// distribution.
constexpr double kTail = 4.0;

const Unknown& at(const std::vector<Unknown>& unknowns, int place) {
  return unknowns[static_cast<std::size_t>(place)];
}

struct Normal {
  VectorXd mean;
  MatrixXd covariance;
};

/// The mode's distribution of some unknowns.
Normal part_of(const PoseMode& mode, const std::vector<int>& places) {
  const auto n = static_cast<Index>(places.size());
  Normal part{VectorXd(n), MatrixXd(n, n)};
  for (Index i = 0; i < n; ++i) {
    const int from = places[static_cast<std::size_t>(i)];
    part.mean[i] = mode.pose[from];
    for (Index j = 0; j < n; ++j) {
      part.covariance(i, j) = mode.covariance(from, places[static_cast<std::size_t>(j)]);
    }
  }
  part.covariance.diagonal().array() += kExact * kExact;
  return part;
}

/// Takes out of a distribution the flat priors of the unknowns that the mode lists as undetermined.
void take_out_prior(const PoseMode& mode, const std::vector<Unknown>& unknowns,
                    const std::vector<int>& places, Normal& part) {
  const Index n = part.mean.size();
  VectorXd scale(n), prior_mean(n), taken(n);
  for (Index i = 0; i < n; ++i) {
    const int place = places[static_cast<std::size_t>(i)];
    const NormalPrior prior = moments_of(at(unknowns, place));
    const bool flat =
        !at(unknowns, place).prior && std::ranges::count(mode.undetermined, place) > 0;
    scale[i] = prior.sigma;
    prior_mean[i] = prior.mean;
    taken[i] = flat ? kTakenOut : 0.0;
  }
  if (taken.isZero()) return;
  // In units of the priors' widths, the prior's precision is 1.
  const MatrixXd inverse_scale = scale.cwiseInverse().asDiagonal();
  const MatrixXd precision = (inverse_scale * part.covariance * inverse_scale).inverse();
  const VectorXd offset = inverse_scale * (part.mean - prior_mean);
  const MatrixXd rest = precision - MatrixXd(taken.asDiagonal());
  const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(rest);
  // A covariance that was inflated beyond the prior's would leave a negative precision.
  const VectorXd variance = axes.eigenvalues().cwiseMax(1 - kTakenOut).cwiseInverse();
  const MatrixXd covariance =
      axes.eigenvectors() * variance.asDiagonal() * axes.eigenvectors().transpose();
  part.mean = prior_mean + scale.asDiagonal() * (covariance * (precision * offset));
  part.covariance = scale.asDiagonal() * covariance * scale.asDiagonal();
}

ShapeRange range_of(double mean, double sigma) {
  return {mean, sigma, mean - kTail * sigma, mean + kTail * sigma};
}

/// Whether a mean is within the limits. A mean outside them (of a tracked object) is not drawn
/// back.
bool inside(double mean, const Unknown& unknown) {
  return mean >= unknown.lower && mean <= unknown.upper;
}

/// Range of a yaw. The mean is turned by whole periods into the period that begins at its unknown's
/// lower limit, and the range is cut to one period.
ShapeRange yaw_range(const Unknown& unknown, double period, double mean, double sigma) {
  const double turned = mean - period * std::floor((mean - unknown.lower) / period);
  ShapeRange range = range_of(turned, sigma);
  range.lower = std::max(range.lower, turned - period / 2);
  range.upper = std::min(range.upper, turned + period / 2);
  if (unknown.range() < period && inside(turned, unknown)) {
    range.lower = std::max(range.lower, unknown.lower);
    range.upper = std::min(range.upper, unknown.upper);
  }
  return range;
}

void limit_positions(const PoseMode& mode, const std::vector<Unknown>& unknowns,
                     const GroundObject& object, ObjectMarginal& marginal) {
  for (const int axis : {0, 1}) {
    const int place = axis == 0 ? object.x : object.y;
    if (place < 0) continue;
    const Unknown& unknown = at(unknowns, place);
    if (!inside(mode.pose[place], unknown)) continue;
    marginal.lower[axis] = unknown.lower;
    marginal.upper[axis] = unknown.upper;
  }
}

}  // namespace

GroundObject::GroundObject(const Scene& scene, int object) {
  const HiddenObject& hidden = hidden_object(scene, object);
  outline = footprint(hidden.shape, hidden.anchor, Placement{});
  known = hidden.placement;
  for (const Vector2d& corner : outline) radius = std::max(radius, corner.norm());
  yaw_period = blindcorner::yaw_period(hidden.shape);
  for (std::size_t i = 0; i < scene.unknowns.size(); ++i) {
    if (scene.unknowns[i].object != object) continue;
    const int place = static_cast<int>(i);
    unknowns.push_back(place);
    const Component component = scene.unknowns[i].component;
    if (component == Component::x) x = place;
    if (component == Component::y) y = place;
    if (component == Component::yaw && yaw_period > 0) yaw = place;
    if (component == Component::size) size = place;
  }
}

NormalPrior moments_of(const Unknown& unknown) {
  if (unknown.prior) return *unknown.prior;
  return {(unknown.lower + unknown.upper) / 2, unknown.range() / std::sqrt(12.0)};
}

PoseMode prior_mode(const std::vector<Unknown>& unknowns, double weight) {
  const auto n = static_cast<Index>(unknowns.size());
  PoseMode mode;
  mode.weight = weight;
  mode.pose.resize(n);
  mode.covariance.setZero(n, n);
  for (Index i = 0; i < n; ++i) {
    const NormalPrior prior = moments_of(unknowns[static_cast<std::size_t>(i)]);
    mode.pose[i] = prior.mean;
    mode.covariance(i, i) = prior.sigma * prior.sigma;
    mode.undetermined.push_back(static_cast<int>(i));
  }
  return mode;
}

std::vector<PoseMode> with_prior(const PoseMixture& mixture, const std::vector<Unknown>& unknowns) {
  // A mixture that leaves less than this to the prior leaves nothing.
  constexpr double kNegligible = 1e-6;
  std::vector<PoseMode> modes = mixture.modes;
  double rest = 1;
  for (const PoseMode& mode : modes) rest -= mode.weight;
  if (rest > kNegligible) modes.push_back(prior_mode(unknowns, rest));
  return modes;
}

bool is_absent(const PoseMode& mode, const GroundObject& object) {
  return !object.unknowns.empty() &&
         std::ranges::all_of(object.unknowns, [&](int i) { return std::isnan(mode.pose[i]); });
}

void check_not_seen(std::span<const double> not_seen, const GridGeometry& grid) {
  if (not_seen.empty() || not_seen.size() == grid.cells()) return;
  throw Error("not_seen", "has " + std::to_string(not_seen.size()) + " values; accepted: " +
                              std::to_string(grid.cells()) + ", one for each cell");
}

ObjectMarginal marginal_of(const PoseMode& mode, const std::vector<Unknown>& unknowns,
                           const GroundObject& object) {
  const std::array<int, 4> all{object.x, object.y, object.yaw, object.size};
  std::vector<int> places;
  std::vector<Index> slots;  // 0, 1: position; 2, 3: yaw, size
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i] < 0) continue;
    places.push_back(all[i]);
    slots.push_back(static_cast<Index>(i));
  }
  Eigen::Vector4d mean(object.known.position.x(), object.known.position.y(), object.known.yaw,
                       object.known.size);
  Eigen::Matrix4d covariance = kExact * kExact * Eigen::Matrix4d::Identity();
  if (!places.empty()) {
    Normal part = part_of(mode, places);
    take_out_prior(mode, unknowns, places, part);
    for (std::size_t i = 0; i < slots.size(); ++i) {
      const auto from = static_cast<Index>(i);
      mean[slots[i]] = part.mean[from];
      for (std::size_t j = 0; j < slots.size(); ++j) {
        covariance(slots[i], slots[j]) = part.covariance(from, static_cast<Index>(j));
      }
    }
  }

  ObjectMarginal marginal;
  marginal.shape_precision = covariance.bottomRightCorner<2, 2>().inverse();
  marginal.slope = covariance.topRightCorner<2, 2>() * marginal.shape_precision;
  marginal.position = mean.head<2>();
  marginal.covariance =
      covariance.topLeftCorner<2, 2>() - marginal.slope * covariance.bottomLeftCorner<2, 2>();
  marginal.yaw = range_of(mean[2], 0.0);
  marginal.size = range_of(mean[3], 0.0);
  if (object.yaw >= 0) {
    marginal.yaw = yaw_range(at(unknowns, object.yaw), object.yaw_period, mean[2],
                             std::sqrt(covariance(2, 2)));
  }
  if (object.size >= 0) {
    const Unknown& unknown = at(unknowns, object.size);
    marginal.size = range_of(mean[3], std::sqrt(covariance(3, 3)));
    marginal.size.lower = std::max(marginal.size.lower, 0.0);
    marginal.size.upper = std::min(marginal.size.upper, 2 * std::max(mean[3], unknown.upper));
    if (inside(mode.pose[object.size], unknown)) {
      marginal.size.lower = std::max(marginal.size.lower, unknown.lower);
      marginal.size.upper = std::min(marginal.size.upper, unknown.upper);
    }
  }
  limit_positions(mode, unknowns, object, marginal);
  return marginal;
}

}  // namespace blindcorner
