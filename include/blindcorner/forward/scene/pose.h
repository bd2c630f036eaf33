// SPDX-License-Identifier: Apache-2.0
/// Placement of the hidden object, and the vector of a scene's unknowns.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

namespace blindcorner {

/// Transforms sensor coordinates to world coordinates (or object to world).
using Transform = Eigen::Isometry3d;

/// Components of the hidden object's placement that may be unknown.
enum class Component { x, y, z, yaw, size };

/// Name with unit, as in results: "x_m", "y_m", "z_m", "yaw_rad", "size".
std::string component_name(Component component);

/// Full placement of an object: position of its anchor in metres (world), yaw in radians about +z
/// (counter-clockwise, 0 along +x), size as a factor on all its lengths.
struct Placement {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double yaw = 0.0;
  double size = 1.0;

  double get(Component component) const;
  void set(Component component, double value);
};

/// Normal prior of one unknown, in the unknown's unit.
struct NormalPrior {
  double mean = 0.0;
  double sigma = 1.0;
};

/// One unknown component. The prior is uniform on [lower, upper], times the normal prior if given.
struct Unknown {
  Component component = Component::x;
  double lower = 0.0;  ///< m, rad or 1
  double upper = 1.0;  ///< m, rad or 1
  std::optional<NormalPrior> prior;
  int object = 0;  ///< the hidden object that the unknown belongs to

  double range() const { return upper - lower; }
};

/// Values of the unknowns in the order of the scene (SI units).
using PoseVector = Eigen::VectorXd;

/// The placement `known` of one object, with its unknown components replaced by values of `pose`.
Placement place(const Placement& known, const std::vector<Unknown>& unknowns,
                const PoseVector& pose, int object = 0);

/// The values of the unknown components of the placement, for a scene with a single object.
PoseVector pose_of(const Placement& placement, const std::vector<Unknown>& unknowns);

/// The same for several objects, one placement each.
PoseVector pose_of(const std::vector<Placement>& placements, const std::vector<Unknown>& unknowns);

}  // namespace blindcorner
