// SPDX-License-Identifier: Apache-2.0
/// Ray queries against the known surfaces. The only place that knows Embree.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

struct RayHit {
  int surface = -1;     ///< index into the scene's surfaces
  double distance = 0;  ///< m
  Eigen::Vector3d point;
  Eigen::Vector3d normal;  ///< unit, of the surface's outer side
};

/// Acceleration structure over bodies made of triangles. Thread safe after construction.
class RayScene {
 public:
  explicit RayScene(const std::vector<Surface>& surfaces);
  /// Bodies given by their triangles; hits name them by index.
  explicit RayScene(const std::vector<std::vector<Triangle>>& bodies);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// First surface along a ray; `direction` need not be normalised.
  std::optional<RayHit> first_hit(const Eigen::Vector3d& origin,
                                  const Eigen::Vector3d& direction) const;

  /// Whether something blocks the straight line between two points. Both points may lie on
  /// surfaces: the ends of the line (1e-4 of its length, because of single precision) do not count.
  bool blocked(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace blindcorner
