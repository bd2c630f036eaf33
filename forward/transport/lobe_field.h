// SPDX-License-Identifier: Apache-2.0
/// The light that a retroreflector's narrow lobe gathers: radiance of the relay, as the object sees
/// it, averaged over the lobe. For the single sum, in place of the radiance in the very direction.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/visibility.h"

namespace blindcorner {

/// Seen relay patches as one object point sees them: arrays of one length, not owned.
struct LobeRays {
  const double *x, *y, *z;     ///< unit directions from the object to the patches
  const double* distance;      ///< m, from the object to the patch
  const double* path;          ///< m, way out: from the object by way of the patch to the detector
  const double* extent;        ///< share of the squared half edges that is variance of the patch:
                               ///< 1/3 of a whole patch, 0 of a point
  const double *lx, *ly, *lz;  ///< gradient of the outer leg at the patch
  const double *ux, *uy, *uz;  ///< half edges, m
  const double *vx, *vy, *vz;
  Eigen::Vector3d normal;  ///< of the object

  LobeRays from(std::size_t n) const;  ///< without the first n
};

/// Light gathered about directions: sums over where it came from. Adds to what is there.
struct LobeSums {
  double* weight;  ///< mean radiance over the lobe, W/m^2/sr
  double* first;   ///< times the path in and out, m
  double* second;  ///< times its square, the path's variance over lobe and patch included

  LobeSums from(std::size_t begin) const { return {weight + begin, first + begin, second + begin}; }
};

/// The lobe is a normal distribution of angles about the direction of departure, so what comes back
/// from a patch is the incident radiance L convolved with the lobe, and with the patch's own extent
/// (a normal distribution of the same covariance; it widens what is left between edges, but edges
/// cut the lobe about the patch's middle: smearing them too made grazing seams worse). L is that of
/// a Lambertian relay under a source of even radiant intensity, on lit polygons: the field of
/// illumination (or a confocal zone's footprint) cut by the relay surfaces, less the shadows that
/// other surfaces cast.
///
/// Of a convex region only the moments of the normal distribution inside of it matter: share, mean
/// and covariance, as coefficients of Hermite polynomials up to the second. Half planes have them
/// in closed form, strips between opposite edges are sums of two. Intersections multiply the
/// series, exact for edges at right angles; at other angles the share lacks terms from the third
/// power of the edges' correlation on (Mehler's formula). Within the region L and the path are
/// taken at two points, one standard deviation of what is left of the lobe to both sides along the
/// relay's tilt, where they change fast: exact to third order.
class LobeField {
 public:
  /// Directions that are looked at together, by judgement: their moments stay in the cache.
  static constexpr std::size_t kChunk = 32;

  LobeField(const Scene& scene, const SensorPlacement& placement);

  /// Edges as a point sees them, made once for all directions.
  class View {
   public:
    /// Light that zone `zone` lights, about each of `count` directions, less what the occluders
    /// hide of it.
    void gather(const LobeRays& rays, std::size_t count, int zone, const LobeSums& sums) const;
    /// The same without and with occluders, `count` at most kChunk; false when no occluder comes
    /// near the lobes.
    bool gather_shaded(const LobeRays& rays, std::size_t count, int zone, const LobeSums& open,
                       const LobeSums& shaded) const;

   private:
    friend class LobeField;
    /// Opposite edges of a region: unit inward normals of the planes through the object and them.
    struct Strip {
      Eigen::Vector3d low, high;
      bool closed = false;  ///< both sides have an edge
    };
    struct Region {
      std::size_t first = 0, end = 0;  ///< strips
    };
    /// Regions that do not overlap and together take light away.
    struct Body {
      std::size_t first = 0, end = 0;  ///< regions
    };
    struct Polygon {
      int zone = -1;        ///< that lights it; -1: all
      double radiance = 0;  ///< W/m^2/sr times m^2: over the cube of the distance to the source
      Eigen::Vector3d normal;
      double height = 0;  ///< of the plane over the object, along the normal
      Region region;
      Body bodies;                ///< range of bodies_
      std::size_t occluders = 0;  ///< first of them that stands between object and relay
    };
    struct Chunk;
    bool reaches(const Region& region, const Chunk& chunk) const;
    void cut(const Region& region, Chunk& chunk) const;
    bool shade(std::size_t first, std::size_t end, Chunk& chunk) const;
    bool fill_light(const Polygon& polygon, Chunk& chunk) const;
    bool shadow_near(const Chunk& chunk, int zone) const;

    Eigen::Vector3d origin_, source_, axis_;
    double sigma_ = 0;
    double cone_tangent_ = 0;  ///< of the field's half angle; 0: not a cone
    std::vector<Polygon> polygons_;
    std::vector<Strip> strips_;
    std::vector<Region> regions_;
    std::vector<Body> bodies_;

    Region add_region(const std::vector<Eigen::Vector3d>& corners,
                      const std::vector<std::pair<int, int>>& sides);
  };
  /// `origin` is a point of the object, m; `occluders` are what may stand before the relay.
  View seen_from(const Eigen::Vector3d& origin, const std::vector<OccluderFace>& occluders) const;

 private:
  using Corners = std::vector<Eigen::Vector3d>;
  using Sides = std::vector<std::pair<int, int>>;  ///< indices of opposite edges; -1: none
  struct Outline {
    Corners corners;
    Sides sides;
  };
  struct LitPolygon {
    int zone = -1;
    double albedo = 0;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    Outline outline;
    std::vector<std::vector<Outline>> shadows;  ///< of each surface that casts one
  };
  static Outline outline(Corners corners, const Eigen::Vector3d& normal);
  void add_lit(const Scene& scene, const std::vector<Eigen::Vector3d>& rays, int zone);
  void cast_shadows(const Scene& scene);

  Eigen::Vector3d source_, axis_;
  double sigma_ = 0;
  double intensity_ = 0;
  double cone_tangent_ = 0;
  std::vector<LitPolygon> polygons_;
};

}  // namespace blindcorner
