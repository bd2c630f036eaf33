// SPDX-License-Identifier: Apache-2.0
/// Hidden objects in each other's way.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/scene/scene.h"
#include "forward/relay/visibility.h"

namespace blindcorner {

/// Hidden objects that stand in the way of light, wherever the pose puts them: flat faces, and
/// round bodies by the silhouettes that a point sees of them.
class MovingBodies {
 public:
  bool empty() const { return faces_.empty() && spheres_.empty() && cylinders_.empty(); }

  void add(const HiddenObject& object, const Placement& placement) {
    const Transform T = object_to_world(object.shape, object.anchor, placement);
    const double size = placement.size;
    if (const auto* sphere = std::get_if<SphereShape>(&object.shape)) {
      spheres_.push_back({T.translation(), size * sphere->radius, 0});
    } else if (const auto* cylinder = std::get_if<CylinderShape>(&object.shape)) {
      cylinders_.push_back({T.translation(), size * cylinder->radius, size * cylinder->height / 2});
    } else {
      const auto* mesh = std::get_if<MeshShape>(&object.shape);
      const bool closed =
          std::holds_alternative<BoxShape>(object.shape) || (mesh != nullptr && mesh->mesh->closed);
      for (const auto& quad : flat_faces(object.shape, T, size)) faces_.push_back({quad, closed});
    }
  }

  /// Adds the faces that hide what lies behind the bodies from a point outside of them.
  void faces_seen_from(const Eigen::Vector3d& point, std::vector<OccluderFace>& faces) const {
    faces.insert(faces.end(), faces_.begin(), faces_.end());
    for (const Round& sphere : spheres_) add_disc(sphere, point, faces);
    for (const Round& cylinder : cylinders_) add_side(cylinder, point, faces);
  }

 private:
  struct Round {
    Eigen::Vector3d center;
    double radius, half_height;
  };

  /// The circle in which the cone of tangents touches the sphere, as an octagon of the same area.
  static void add_disc(const Round& sphere, const Eigen::Vector3d& point,
                       std::vector<OccluderFace>& faces) {
    const Eigen::Vector3d way = sphere.center - point;
    const double share = std::pow(sphere.radius, 2) / way.squaredNorm();
    if (share >= 1) return;
    const double reach =
        sphere.radius * std::sqrt(1 - share) * std::sqrt(kPi / (2 * std::numbers::sqrt2));
    const Eigen::Vector3d u = way.unitOrthogonal();
    const Eigen::Vector3d v = way.normalized().cross(u);
    std::array<Eigen::Vector3d, 8> corners;
    for (std::size_t k = 0; k < 8; ++k) {
      const double angle = kPi / 4 * (static_cast<double>(k) + 0.5);
      corners[k] = point + (1 - share) * way + reach * (std::cos(angle) * u + std::sin(angle) * v);
    }
    faces.push_back({{corners[0], corners[1], corners[2], corners[3]}, false});
    faces.push_back({{corners[0], corners[3], corners[4], corners[7]}, false});
    faces.push_back({{corners[4], corners[5], corners[6], corners[7]}, false});
  }

  /// The upright rectangle between the tangents to the cylinder's side; what its caps hide besides,
  /// seen from above or below, is left out.
  static void add_side(const Round& cylinder, const Eigen::Vector3d& point,
                       std::vector<OccluderFace>& faces) {
    Eigen::Vector3d way = cylinder.center - point;
    way.z() = 0;
    const double share = std::pow(cylinder.radius, 2) / way.squaredNorm();
    if (!(share < 1)) return;
    const Eigen::Vector3d across =
        cylinder.radius * std::sqrt(1 - share) * Eigen::Vector3d(-way.y(), way.x(), 0).normalized();
    const Eigen::Vector3d up(0, 0, cylinder.half_height);
    const Eigen::Vector3d center = cylinder.center - share * way;
    faces.push_back(
        {{center - across - up, center + across - up, center + across + up, center - across + up},
         false});
  }

  std::vector<OccluderFace> faces_;
  std::vector<Round> spheres_, cylinders_;
};

}  // namespace blindcorner
