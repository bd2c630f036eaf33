// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/forward/scene/pose.h"

namespace blindcorner {

std::string component_name(Component component) {
  switch (component) {
    case Component::x:
      return "x_m";
    case Component::y:
      return "y_m";
    case Component::z:
      return "z_m";
    case Component::yaw:
      return "yaw_rad";
    case Component::size:
      return "size";
  }
  return {};
}

double Placement::get(Component component) const {
  switch (component) {
    case Component::yaw:
      return yaw;
    case Component::size:
      return size;
    default:
      return position[static_cast<int>(component)];
  }
}

void Placement::set(Component component, double value) {
  switch (component) {
    case Component::yaw:
      yaw = value;
      break;
    case Component::size:
      size = value;
      break;
    default:
      position[static_cast<int>(component)] = value;
  }
}

Placement place(const Placement& known, const std::vector<Unknown>& unknowns,
                const PoseVector& pose, int object) {
  Placement placement = known;
  for (std::size_t i = 0; i < unknowns.size(); ++i) {
    if (unknowns[i].object != object) continue;
    placement.set(unknowns[i].component, pose[static_cast<Eigen::Index>(i)]);
  }
  return placement;
}

PoseVector pose_of(const Placement& placement, const std::vector<Unknown>& unknowns) {
  return pose_of(std::vector<Placement>{placement}, unknowns);
}

PoseVector pose_of(const std::vector<Placement>& placements, const std::vector<Unknown>& unknowns) {
  PoseVector pose(static_cast<Eigen::Index>(unknowns.size()));
  for (std::size_t i = 0; i < unknowns.size(); ++i) {
    const Placement& placement = placements[static_cast<std::size_t>(unknowns[i].object)];
    pose[static_cast<Eigen::Index>(i)] = placement.get(unknowns[i].component);
  }
  return pose;
}

}  // namespace blindcorner
