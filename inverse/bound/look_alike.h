// SPDX-License-Identifier: Apache-2.0
/// Poses that look like a true one when brightness, ambient light and direct return are unknown.
/// These take the values that make the two poses hardest to tell apart.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "inverse/likelihood/linear_unknowns.h"

namespace blindcorner {

/// Light of the test poses, one column each, rows as in the observation's time gates.
struct TestLight {
  Eigen::MatrixXd light;   ///< [rows, K] counts at unit amplitude
  Eigen::MatrixXd square;  ///< the same squared
};

/// The true state that test poses are compared with.
class LookAlike {
 public:
  /// `linear` holds the true linear unknowns, `shapes` [observed zones] the light at the true pose.
  LookAlike(const LinearSolver& solver, std::span<const ZoneShapes> shapes,
            const LinearSolution& linear);

  /// Poses that some capture may confuse with the true one.
  struct Confused {
    std::vector<Eigen::Index> index;  ///< into the columns of the test light
    /// [features, 1 + confused] less those of the true pose, which is the first column. Half the
    /// squared distance of two columns is minus the logarithm of their Bhattacharyya coefficient.
    Eigen::MatrixXd roots;
  };
  /// Test poses whose squared Bhattacharyya coefficient with the true pose is at least
  /// `negligible`.
  Confused confused(const TestLight& test, double negligible) const;

 private:
  struct OfZone {
    int row = 0, bins = 0;
    Eigen::VectorXd truth;      ///< [bins] expected counts
    Eigen::VectorXd weight;     ///< [bins] inverse variance
    Eigen::MatrixXd basis;      ///< [bins, 2] ambient light and direct return, 0 where not free
    Eigen::Matrix2d inverse;    ///< of their information
    Eigen::VectorXd light;      ///< [bins] the object's at the true pose and amplitude
    Eigen::Vector2d explained;  ///< weighted product of that light and the basis
    double amplitude = 0, ambient = 0, direct = 0;
  };
  /// Squared distance as a quadratic in the amplitude a: norm a^2 - 2 projection a + constant.
  struct Fit {
    Eigen::MatrixXd norm, projection;        ///< [zones or 1, K]
    std::vector<Eigen::MatrixXd> explained;  ///< [zones] of [2, K]
    double constant = 0;
  };

  Fit compare(const TestLight& test) const;
  double amplitude_for(double norm, double projection, double truth) const;
  Eigen::VectorXd roots_of(const TestLight& test, const Fit& fit, Eigen::Index column,
                           const Eigen::VectorXd& amplitude) const;
  double root(std::size_t zone, double counts) const;

  const LinearSolver& solver_;
  std::vector<OfZone> zones_;
  Eigen::Index features_ = 0;
};

}  // namespace blindcorner
