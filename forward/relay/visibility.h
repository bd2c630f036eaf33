// SPDX-License-Identifier: Apache-2.0
/// Continuous visibility: which share of a flat patch an object point sees past the occluders.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/transport/transport_plan.h"
#include "forward/scene/shapes/shape_geometry.h"

namespace blindcorner {

/// Faces of the surfaces marked as occluders.
std::vector<OccluderFace> occluder_faces(const std::vector<Surface>& surfaces);

/// The visible part of a patch.
struct VisiblePart {
  double fraction = 1.0;                            ///< of the area
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();  ///< of the centroid, m
};

/// Centres and half edges of many patches, one array for each coordinate.
struct PatchCoordinates {
  std::array<const double*, 3> center, half_u, half_v;
};

/// Shadows of flat occluders as seen from one point.
///
/// The points that a convex face hides from a viewpoint form a pyramid. It lies within the half
/// spaces through the viewpoint and the face's edges and beyond the face's own plane. A patch is
/// clipped against these planes exactly, so its visible fraction is continuous (and piecewise
/// smooth) in the viewpoint, for any number of occluders.
class ShadowView {
 public:
  ShadowView(const std::vector<OccluderFace>& faces, const Eigen::Vector3d& viewpoint);

  /// Adds a flat convex face of three to kMaxOutline corners in order (m). Without corners, nothing
  /// is added. `viewpoint` is the constructor's.
  void add(std::span<const Eigen::Vector3d> corners, bool one_sided,
           const Eigen::Vector3d& viewpoint);

  /// Forgets the faces that hide nothing of a ball.
  void leave_out_clear_of(const Eigen::Vector3d& center, double radius);
  /// Whether no face is left to hide anything.
  bool empty() const { return pyramids_.empty(); }

  enum class Sight { clear, mixed, hidden };

  /// Quick answer for a whole ball: certainly clear, certainly hidden by one face, or not sure.
  Sight sight(const Eigen::Vector3d& center, double radius) const;

  static constexpr int kChunk = 16;  ///< patches that are looked at together
  /// Quick answer for each of the patches [begin, end). The coordinates must be readable in whole
  /// chunks from `begin` on.
  void sights(const PatchCoordinates& patches, int begin, int end, Sight* out) const;

  /// Part of the parallelogram center +- half_u +- half_v that is not in shadow.
  VisiblePart see(const Eigen::Vector3d& center, const Eigen::Vector3d& half_u,
                  const Eigen::Vector3d& half_v) const;

 private:
  struct HalfSpace {
    Eigen::Vector3d normal;
    double offset;
  };
  /// Half spaces of the face's own plane and of each edge.
  struct Pyramid {
    std::array<HalfSpace, kMaxOutline + 1> sides;
    std::size_t count = 0;

    const HalfSpace* begin() const { return sides.data(); }
    const HalfSpace* end() const { return sides.data() + count; }
  };
  std::vector<Pyramid> pyramids_;
};

}  // namespace blindcorner
