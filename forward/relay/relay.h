// SPDX-License-Identifier: Apache-2.0
/// Relay sampling: which pieces of the known surfaces the sensor lights and sees.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "forward/relay/ray_scene.h"

namespace blindcorner {

/// Flat piece of a known surface (metres, world). The viewpoint is the light or the detector.
struct RelayPatch {
  Eigen::Vector3d center;
  Eigen::Vector3d normal;                            ///< unit, towards the side that reflects
  Eigen::Vector3d half_u = Eigen::Vector3d::Zero();  ///< half edges on the surface
  Eigen::Vector3d half_v = Eigen::Vector3d::Zero();
  double solid_angle = 0.0;  ///< sr, from the viewpoint
  double distance = 0.0;     ///< m, from the viewpoint
  double albedo = 0.0;
  int surface = -1;
  int group = 0;      ///< one pulse may stand for all patches of a group
  bool whole = true;  ///< false: one surface's part of a cell that several surfaces share
  /// Centre of the area that the patch stands for; a Gauss node lies a little off this centre.
  Eigen::Vector3d area_center;
  bool node = false;  ///< Gauss node: its half edges span its part of the cell; no spread
};

/// Decides which edge of a patch is halved: 0 none, 1 half_u, 2 half_v.
using Split = std::function<int(const RelayPatch&)>;

/// Places of a cell on its surface (m, world): [v][u] at the lower end, the middle and the upper
/// end of its range.
using CellPlaces = std::array<std::array<Eigen::Vector3d, 3>, 3>;

struct RelaySampling {
  int divisions = 1;   ///< least number of divisions of the region along each side
  int edge_depth = 4;  ///< quarterings where a cell straddles the border of surfaces
  int edge_rays = 34;  ///< rays that divide such a cell among its surfaces; a Fibonacci number
  /// Distance of a cell's corner rays from its corners, as a share of its edges, so that a field
  /// that ends on a surface's edge is not mixed. A border nearer to a cell's edge is overlooked.
  double edge_inset = 0.02;
  bool centers_only = false;  ///< one ray to a cell: the surface at its centre stands for all of it
  bool with_radiance = true;  ///< compute the radiance that seen patches send back
  int split_depth = 12;       ///< largest number of halvings by `split` or `points`
  Split split;                ///< divides cells further; may be empty
  /// If the centre and corners of a cell see one flat surface, its halves are taken to see the same
  /// surface, without further rays.
  bool halves_inherit = false;
  /// Numbers of Gauss-Legendre points along half_u and half_v that represent a cell. The points
  /// form one group. n points are exact for weights of degree 2 n - 1, and the points' spread is
  /// the cell's. {1, 1} is the centre, with the cell's spread. Empty: always the centre.
  std::function<std::array<int, 2>(const RelayPatch&)> nodes;
  /// Replaces `split` and `nodes` for cells that see one surface. It tells how many points a cell
  /// needs along both edges; the number is below one where less than one would do. Cells that need
  /// more than `most_points` are halved.
  std::function<std::array<double, 2>(const RelayPatch&, const CellPlaces&)> points;
  double most_points = 1;
  /// Nodes have the edges of their own part of the cell; else they have the whole cell's edges.
  bool node_extents = true;
};

/// Casts the region's directions from `origin` and returns the patches that they hit. The cells
/// account for the region's whole solid angle; directions that hit nothing give no patch. The
/// region's axis is the sensor's +x under `rotation` (sensor to world).
std::vector<RelayPatch> sample_region(const RayScene& rays, const std::vector<Surface>& surfaces,
                                      const Eigen::Vector3d& origin,
                                      const Eigen::Matrix3d& rotation,
                                      const FieldOfIllumination& region,
                                      const RelaySampling& sampling);

/// Unit vector (sensor frame) for tangent coordinates right and down.
inline Eigen::Vector3d direction_from_tangents(double right, double down) {
  const double inverse = 1 / std::sqrt(1 + right * right + down * down);
  return {inverse, -right * inverse, -down * inverse};
}

/// Two unit directions u and v along a surface with this normal. u is horizontal (x where every
/// direction is horizontal). v = normal x u, which points up on a wall.
std::pair<Eigen::Vector3d, Eigen::Vector3d> surface_axes(const Eigen::Vector3d& normal);

/// Solid angle of a region of directions (rectangle or cone), sr.
double solid_angle(const FieldOfIllumination& region);

/// Whether a sensor-frame direction lies inside the region.
bool contains(const FieldOfIllumination& region, const Eigen::Vector3d& direction);

/// The patch of a known relay point. The nearest relay surface gives its normal and albedo; its
/// extent is zero and its solid angle one. Throws Error when no relay surface is within `tolerance`
/// metres.
RelayPatch relay_point_patch(const std::vector<Surface>& surfaces, const Eigen::Vector3d& point,
                             double tolerance);

}  // namespace blindcorner
