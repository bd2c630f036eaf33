// SPDX-License-Identifier: Apache-2.0
/// The light of a hidden object over one mode of the posterior, as a polynomial of the pose.
///
/// Over the posterior of one mode the expected histogram changes by a few standard deviations of
/// its noise only: if it changed by more, the posterior would be smaller. In coordinates z in which
/// that posterior is round,
///
///     pose = center + root z,      light(pose) = sum_k c_k phi_k(z),
///
/// phi_k the monomials up to a degree. The coefficients are least squares through exact light at
/// nodes within local_reach() standard deviations, which weigh less farther out. A fit of k
/// monomials takes 1.6 k + 2 nodes or more.
///
/// *Error.* What the polynomial, fitted without a node, misses there is the node's residual over
/// one minus its leverage (the leave-one-out residual, exact for least squares). With the
/// information w of a bin about its light (1 / variance), light that is off by d changes the log
/// likelihood of a right pose by a random amount of variance sum(w d^2). error() is the mean of
/// half of that sum over the nodes, each weighed as a round posterior weighs it: at 0.05 the log
/// likelihood is off by 0.3 at random. It follows from the nodes' Gram matrix alone, whatever the
/// number of bins.
///
/// *What follows.* The degree is the one with the least error that the nodes suffice for. Where
/// that error is above the tolerance there is no local model, and whoever asked goes on with exact
/// light until there are more nodes.
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

/// Standard deviations to which a local model of so many unknowns reaches: of a normal posterior
/// one part in a thousand lies beyond (three unknowns 4.03, six 4.74).
double local_reach(Eigen::Index unknowns);

/// Exact light at a pose, [rows] at unit amplitude.
struct LightNode {
  PoseVector pose;
  Eigen::VectorXd light;
};

class LocalModel {
 public:
  /// The polynomial of the least error through those of `nodes` that lie in the region, at most
  /// kMaxNodes of them; nothing where that error is above `tolerance`, or where they are too few
  /// for the second degree. `row_information` [rows] is the information of each row about its light
  /// at unit amplitude.
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

/// Most nodes of a fit, enough for degree 4 of three unknowns (58), 3 of four (58), 3 of two
/// objects with three unknowns each (79).
inline constexpr std::size_t kMaxNodes = 80;

/// Exponents of all monomials of `object_of.size()` unknowns up to a degree; where they belong to
/// several objects, mixed ones of several objects up to the second degree only: light of several
/// objects adds but for their shadows on each other.
std::vector<std::vector<int>> monomials_up_to(int degree, const std::vector<int>& object_of);

/// Mean over the nodes of what a fit without each of them misses there, half the squared residual.
/// `design` [nodes, terms] and `gram` [nodes, nodes], the products of the nodes' lights, are those
/// of nodes of weight one; `weight` [nodes] multiplies equations.
double leave_one_out_error(const Eigen::MatrixXd& design, const Eigen::VectorXd& weight,
                           const Eigen::MatrixXd& gram);

}  // namespace blindcorner
