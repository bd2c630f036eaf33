// SPDX-License-Identifier: Apache-2.0
/// Hidden objects as occluders.
#pragma once

#include <utility>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "forward/relay/visibility.h"
#include "forward/scene/shapes/shape_geometry.h"

namespace blindcorner {

/// Hidden objects that stand in the way of light, at any pose. A flat shape is kept as faces. A
/// round body is kept as a function that gives the silhouette which a point sees of it.
class MovingBodies {
 public:
  bool empty() const { return flat_.empty() && round_.empty(); }

  void add(const HiddenObject& object, const Placement& placement) {
    const Transform T = object_to_world(object.shape, object.anchor, placement);
    const auto geometry = geometry_of(object.shape);
    Silhouette silhouette = geometry->silhouette({T, placement.size});
    for (const Quad& quad : silhouette.faces) flat_.push_back({quad, geometry->closed()});
    if (silhouette.seen_from) round_.push_back(std::move(silhouette.seen_from));
  }

  /// Adds the faces that hide what lies behind the bodies as seen from `point`, outside of them.
  void faces_seen_from(const Eigen::Vector3d& point, std::vector<OccluderFace>& faces) const {
    faces.insert(faces.end(), flat_.begin(), flat_.end());
    for (const auto& seen_from : round_) {
      const std::vector<Eigen::Vector3d> outline = seen_from(point);
      for (std::size_t k = 2; k < outline.size(); k += 2) {
        const Eigen::Vector3d& last = outline[(k + 1) % outline.size()];
        faces.push_back({{outline[0], outline[k - 1], outline[k], last}, false});
      }
    }
  }

  /// Adds the bodies to the shadows that `point` sees. A round outline is added as one face: the
  /// quick test ShadowView::sight() then finds more hidden than with the outline's parts.
  void cast(const Eigen::Vector3d& point, ShadowView& shadows) const {
    for (const OccluderFace& face : flat_) shadows.add(face.corners, face.one_sided, point);
    for (const auto& seen_from : round_) shadows.add(seen_from(point), false, point);
  }

 private:
  std::vector<OccluderFace> flat_;
  std::vector<decltype(Silhouette::seen_from)> round_;
};

}  // namespace blindcorner
