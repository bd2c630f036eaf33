// SPDX-License-Identifier: Apache-2.0
/// The light of a hidden object over one mode of the posterior, as a polynomial of the pose.
///
/// Over the posterior of one mode, the expected histogram changes by only a few standard deviations
/// of its noise: if it changed by more, the posterior would be smaller. In coordinates z in which
/// that posterior is round,
///
///     pose = center + root z,      light(pose) = sum_k c_k phi_k(z),
///
/// where phi_k are the monomials up to a degree. The coefficients are a least-squares fit to exact
/// light at nodes within local_reach() standard deviations. Nodes farther out weigh less. A fit of
/// k monomials takes 1.6 k + 2 nodes or more.
///
/// *Error.* A polynomial that is fitted without a node misses the light at that node by the node's
/// residual over one minus its leverage (the leave-one-out residual, exact for least squares). Let
/// w be the information of a bin about its light (1 / variance). Light that is off by d changes the
/// log likelihood of a right pose by a random amount of variance sum(w d^2). error() is the mean of
/// half of that sum over the nodes, with the squares of the nodes' weights in the fit: at 0.05 the
/// log likelihood is off by 0.3 at random. It follows from the nodes' Gram matrix alone, whatever
/// the number of bins.
///
/// *What follows.* Of the degrees for which there are enough nodes, the one with the least error is
/// taken. Where that error is above the tolerance, there is no local model, and the caller goes on
/// with exact light until there are more nodes.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// An ellipsoid in which a local model holds: pose = center + root * z with |z| <= local_reach(n).
struct LocalRegion {
  PoseVector center;
  Eigen::MatrixXd root;  ///< [n, n] lower triangular, one standard deviation
};

/// Reach of a local model with this many unknowns, in standard deviations. One part in a thousand
/// of a normal posterior lies beyond it (three unknowns 4.03, six 4.74).
double local_reach(Eigen::Index unknowns);

/// Exact light at a pose, [rows] at unit amplitude.
struct LightNode {
  PoseVector pose;
  Eigen::VectorXd light;
};

class LocalModel {
 public:
  /// Fits the polynomial with the least error to those of `nodes` that lie in the region, at most
  /// kMaxNodes of them. Returns nothing if that error is above `tolerance`, or if there are too few
  /// nodes for the second degree. `row_information` [rows] is the information of each row about its
  /// light at unit amplitude.
  static std::optional<LocalModel> fit(const Scene& scene, LocalRegion region,
                                       const std::vector<LightNode>& nodes,
                                       const Eigen::VectorXd& row_information, double tolerance);

  bool covers(const Scene& scene, const PoseVector& pose) const;
  /// [rows] Light at a pose, not negative.
  void light(const Scene& scene, const PoseVector& pose, double* out) const;

  int degree() const { return degree_; }
  double error() const { return error_; }

 private:
  explicit LocalModel(LocalRegion region)
      : region_(std::move(region)), reach_(local_reach(region_.center.size())) {}

  LocalRegion region_;
  double reach_;
  std::vector<std::vector<int>> exponents_;  ///< [terms][n]
  Eigen::MatrixXd coefficients_;             ///< [rows, terms]
  int degree_ = 0;
  double error_ = 0;
};

/// Most nodes of a fit: enough for degree 4 with three unknowns (58), for degree 3 with four (58),
/// and for degree 3 with two objects of three unknowns each (79).
inline constexpr std::size_t kMaxNodes = 80;

/// Exponents of all monomials of `object_of.size()` unknowns up to a degree. Monomials that mix
/// unknowns of several objects go up to the second degree only, because the light of several
/// objects adds except for their shadows on each other.
std::vector<std::vector<int>> monomials_up_to(int degree, const std::vector<int>& object_of);

/// Mean over the nodes, with squared weights, of half the squared residual that a fit without the
/// node has there. `design` [nodes, terms] and `gram` [nodes, nodes], the products of the nodes'
/// lights, are those of nodes of weight one. `weight` [nodes] multiplies the nodes' equations.
double leave_one_out_error(const Eigen::MatrixXd& design, const Eigen::VectorXd& weight,
                           const Eigen::MatrixXd& gram);

}  // namespace blindcorner
