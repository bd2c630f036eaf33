// SPDX-License-Identifier: Apache-2.0
/// Expected (Fisher) information of a capture about poses, the linear unknowns eliminated.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "inverse/search/refine.h"

namespace blindcorner {

/// Sum of (dm/du)(dm/du)' / variance over all bins, m the expected counts and u any unknowns; the
/// linear unknowns that a zone has for itself are eliminated by the Schur complement. `slope`
/// [rows, n] holds the derivatives of the object's light in u at unit amplitude. `gradient`, unless
/// null, becomes that of the log likelihood in u, [n].
Eigen::MatrixXd fisher_information(const LinearSolver& solver, std::span<const ZoneShapes> shapes,
                                   const LinearSolution& linear, const Eigen::MatrixXd& slope,
                                   Eigen::VectorXd* gradient = nullptr);

/// [rows] Information of each bin about the object's light in it at unit amplitude, 1 / variance.
Eigen::VectorXd row_information(const LinearSolver& solver, std::span<const ZoneShapes> shapes,
                                const LinearSolution& linear);

/// Models compiled with the sensor moved by +-step along each of x, y, z (m) and turned about each
/// world axis (rad).
struct MovedModels {
  std::array<ModelSet, 6> plus, minus;
  std::array<double, 6> step{};
};

/// [rows, 6] Derivatives of the object's light at unit amplitude in the sensor's pose.
Eigen::MatrixXd sensor_slope(const PoseObjective& objective, const MovedModels& moved,
                             const PoseVector& pose);

/// Information about the pose; pose priors not included.
struct PoseInformation {
  Eigen::MatrixXd pose;  ///< [n, n]
  /// [n, k] with what disturbs the light: where the light is disturbance * d brighter than the
  /// model says, the optimum moves by pose^-1 * disturbance_pose * d.
  Eigen::MatrixXd disturbance;
  double signal = 0;  ///< squared signal-to-noise ratio of the object's light
};

/// All linear unknowns eliminated, a shared amplitude with them. `at` is the light at a pose,
/// `linear` what is expected there, `slope` [rows, n] the derivatives of that light in the pose,
/// `disturbance` [rows, k] of light at unit amplitude.
PoseInformation pose_information(const PoseObjective& objective, const ShapeBuffer& at,
                                 const LinearSolution& linear, const Eigen::MatrixXd& slope,
                                 const Eigen::MatrixXd& disturbance = {});

/// The same at an optimum.
PoseInformation pose_information(const PoseObjective& objective, const Refined& optimum,
                                 const Eigen::MatrixXd& disturbance = {});

}  // namespace blindcorner
