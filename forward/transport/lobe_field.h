// SPDX-License-Identifier: Apache-2.0
/// The light that a retroreflector's narrow lobe gathers: the radiance of the relay as the object
/// sees it, averaged over the lobe. The single sum uses it in place of the radiance in the lobe's
/// exact direction.
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
  const double* extent;        ///< variance of the patch as a share of its squared half edges: 1/3
                               ///< for a whole patch, 0 for a point
  const double *lx, *ly, *lz;  ///< gradient of the outer leg at the patch
  const double *ux, *uy, *uz;  ///< half edges, m
  const double *vx, *vy, *vz;
  Eigen::Vector3d normal;  ///< of the object

  LobeRays from(std::size_t n) const;  ///< without the first n
};

/// Light that lobes about directions gather, as sums over the places that it came from. Gathering
/// adds to the sums.
struct LobeSums {
  double* weight;  ///< mean radiance over the lobe, W/m^2/sr
  double* first;   ///< radiance times the path in and out, m
  double* second;  ///< radiance times the path's square, variance over lobe and patch included

  LobeSums from(std::size_t begin) const { return {weight + begin, first + begin, second + begin}; }
};

/// The lobe is a normal distribution of angles about the direction of departure. The light that
/// leaves towards a patch is therefore the incident radiance L, convolved with the lobe and with
/// the patch's own extent. The extent counts as a normal distribution of the same covariance. It
/// widens the part of the lobe that is left between edges. The edges themselves cut the lobe about
/// the patch's middle, because smearing them too made grazing seams worse. L is the radiance of a
/// Lambertian relay under a source of even radiant intensity. It fills the lit polygons: the field
/// of illumination (or a confocal zone's footprint) cut by the relay surfaces, less the shadows
/// that other surfaces cast.
///
/// A convex region counts only by the moments of the normal distribution inside it: share, mean and
/// covariance, as coefficients of Hermite polynomials up to the second. They have a closed form for
/// a half plane; a strip between opposite edges is a sum of two half planes. Two regions intersect
/// by the product of their series. This is exact for edges at right angles; at other angles the
/// share lacks the terms from the third power of the edges' correlation on (Mehler's formula). L
/// and the path are evaluated at two points of the region, one standard deviation of the remaining
/// lobe to either side of its mean along the relay's tilt, where both change fast: exact to third
/// order.
class LobeField {
 public:
  /// Number of directions that are handled together. By judgement: their moments stay in the cache.
  static constexpr std::size_t kChunk = 32;

  LobeField(const Scene& scene, const SensorPlacement& placement);

  /// Edges as a point sees them, made once for all directions.
  class View {
   public:
    /// Gathers, about each of `count` directions, the light that zone `zone` lights, less what the
    /// occluders hide of it.
    void gather(const LobeRays& rays, std::size_t count, int zone, const LobeSums& sums) const;
    /// Gathers the same light without occluders (`open`) and with them (`shaded`); `count` is at
    /// most kChunk. Gathers nothing and returns false if no occluder comes near the lobes.
    bool gather_shaded(const LobeRays& rays, std::size_t count, int zone, const LobeSums& open,
                       const LobeSums& shaded) const;

   private:
    friend class LobeField;
    /// Two opposite edges of a region, as unit inward normals of the planes through the object and
    /// each edge.
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
      int zone = -1;        ///< that lights the polygon; -1: all
      double radiance = 0;  ///< W/m^2/sr times m^3: over the cube of the distance to the source
      Eigen::Vector3d normal;
      double height = 0;  ///< of the plane over the object, along the normal
      Region region;
      Body bodies;                ///< range of bodies_
      std::size_t occluders = 0;  ///< first body that stands between object and relay
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
  /// `origin` is a point of the object, m; `occluders` are the faces that may hide parts of the
  /// relay.
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
