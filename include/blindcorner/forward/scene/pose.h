// SPDX-License-Identifier: Apache-2.0
/// Where the hidden object is: placements, and the vector of unknowns that a scene frees.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

namespace blindcorner {

/// Takes sensor coordinates to world coordinates (or object to world).
using Transform = Eigen::Isometry3d;

/// What may be unknown about the hidden object.
enum class Component { x, y, z, yaw, size };

/// Name with unit as results use it: "x_m", "y_m", "z_m", "yaw_rad", "size".
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

/// One freed component: the prior is uniform on [lower, upper], times the normal one if given.
struct Unknown {
  Component component = Component::x;
  double lower = 0.0;  ///< m, rad or 1
  double upper = 1.0;  ///< m, rad or 1
  std::optional<NormalPrior> prior;
  int object = 0;  ///< which of the scene's hidden objects it belongs to

  double range() const { return upper - lower; }
};

/// Values of the unknowns in the order in which the scene lists them (SI units).
using PoseVector = Eigen::VectorXd;

/// `known` with the values of `pose` put in place of the unknown components of one object.
Placement place(const Placement& known, const std::vector<Unknown>& unknowns,
                const PoseVector& pose, int object = 0);

/// The values of the unknown components of the only object's placement.
PoseVector pose_of(const Placement& placement, const std::vector<Unknown>& unknowns);

/// The same for several objects, one placement each.
PoseVector pose_of(const std::vector<Placement>& placements, const std::vector<Unknown>& unknowns);

}  // namespace blindcorner
