// SPDX-License-Identifier: Apache-2.0
/// Derivatives of the object's light in the pose.
#pragma once

#include <Eigen/Core>

#include "inverse/likelihood/pose_objective.h"

namespace blindcorner {

/// [rows] The object's light.
inline Eigen::Map<const Eigen::VectorXd> light_of(const ShapeBuffer& buffer) {
  return {buffer.object.data(), static_cast<Eigen::Index>(buffer.object.size())};
}

/// Differences in steps of CompiledScene::step.
enum class Differences {
  one_sided,  ///< forward, backward at an upper bound: 3 % of the derivatives' own scale off
  central
};

/// [rows, unknowns] Derivatives of the object's light at unit amplitude in the pose. `here` is the
/// light at the pose, from which one-sided differences are taken.
void light_slope(const PoseObjective& objective, const LightSource& source, const PoseVector& pose,
                 const ShapeBuffer& here, Differences differences, Eigen::MatrixXd& slope);

/// [rows] The same in one unknown. Central differences do not look at `here`.
void light_slope(const PoseObjective& objective, const LightSource& source, const PoseVector& pose,
                 const ShapeBuffer& here, Differences differences, Eigen::Index unknown,
                 Eigen::Ref<Eigen::VectorXd> column);

/// The derivatives in all unknowns, by one-sided differences.
Eigen::MatrixXd light_slope(const PoseObjective& objective, const LightSource& source,
                            const PoseVector& pose);

}  // namespace blindcorner
