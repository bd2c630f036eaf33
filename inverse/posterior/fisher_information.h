// SPDX-License-Identifier: Apache-2.0
/// Expected (Fisher) information of a capture about poses, the linear unknowns eliminated.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "inverse/search/refine.h"

namespace blindcorner {

/// Sum of (dm/du)(dm/du)' / variance over all bins, where m are the expected counts and u any
/// unknowns. Linear unknowns that belong to a single zone are eliminated by the Schur complement.
/// `slope` [rows, n] holds the derivatives, with respect to u, of the object's light at unit
/// amplitude. `gradient`, unless null, receives the gradient of the log likelihood with respect to
/// u, [n].
Eigen::MatrixXd fisher_information(const LinearSolver& solver, std::span<const ZoneShapes> shapes,
                                   const LinearSolution& linear, const Eigen::MatrixXd& slope,
                                   Eigen::VectorXd* gradient = nullptr);

/// [rows] Information, 1 / variance, of each bin about the object's light at unit amplitude in that
/// bin.
Eigen::VectorXd row_information(const LinearSolver& solver, std::span<const ZoneShapes> shapes,
                                const LinearSolution& linear);

/// Models compiled with the sensor moved by +-step along x, y and z (m), and turned by +-step about
/// each world axis (rad).
struct MovedModels {
  std::array<ModelSet, 6> plus, minus;
  std::array<double, 6> step{};
};

/// [rows, 6] Derivatives of the object's light at unit amplitude with respect to the sensor's pose.
Eigen::MatrixXd sensor_slope(const PoseObjective& objective, const MovedModels& moved,
                             const PoseVector& pose);

/// Information about the pose; pose priors not included.
struct PoseInformation {
  Eigen::MatrixXd pose;  ///< [n, n]
  /// [n, k] Cross information of the pose and disturbances of the light. Where the light is
  /// brighter than the model says by the argument `disturbance` times d, the optimum moves by
  /// pose^-1 times this matrix times d.
  Eigen::MatrixXd disturbance;
  double signal = 0;  ///< squared signal-to-noise ratio of the object's light
};

/// Information with all linear unknowns eliminated, including a shared amplitude. `at` is the light
/// at a pose, `linear` holds the linear unknowns there, `slope` [rows, n] the derivatives of that
/// light with respect to the pose, and `disturbance` [rows, k] changes of the light at unit
/// amplitude.
PoseInformation pose_information(const PoseObjective& objective, const ShapeBuffer& at,
                                 const LinearSolution& linear, const Eigen::MatrixXd& slope,
                                 const Eigen::MatrixXd& disturbance = {});

/// The same at an optimum.
PoseInformation pose_information(const PoseObjective& objective, const Refined& optimum,
                                 const Eigen::MatrixXd& disturbance = {});

}  // namespace blindcorner
