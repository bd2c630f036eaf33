// SPDX-License-Identifier: Apache-2.0
/// The light that a retroreflector's narrow lobe gathers: radiance of the relay, as the object sees
/// it, averaged over the lobe. For the single sum, in place of the radiance in the very direction.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "blindcorner/forward/forward_model.h"
#include "blindcorner/forward/visibility.h"

namespace blindcorner {

/// Light gathered about one direction: sums over where it came from.
struct GatheredLight {
  double weight = 0;  ///< mean radiance over the lobe, W/m^2/sr
  double first = 0;   ///< times the path from the source to the object, m
  double second = 0;  ///< times the square of that path, its variance over the lobe included
};

/// What of a standard normal distribution is left between edges on both sides.
struct Strip {
  double low = 1, high = 1;  ///< shares inside of the edges of either side
  double low_density = 0, high_density = 0;
  double low_slope = 0, high_slope = 0;  ///< distance times density

  /// An edge at `distance`, positive when the middle of the distribution lies inside.
  void cut(bool upper, double distance);
  double share() const { return std::max(low + high - 1, 0.0); }
  double mean() const;
  double variance() const;
};

/// The lobe is a normal distribution of angles (standard deviation s) about the direction of
/// departure, so what comes back from direction w is the incident radiance L convolved with it.
/// L is that of a Lambertian relay under a source of even radiant intensity, on lit polygons: the
/// field of illumination (or a confocal zone's footprint) cut by the relay surfaces. Each polygon's
/// share of the lobe is a product of two strips' shares in the directions along the relay's tilt
/// and across it; edges are great circles, exact for one edge and for two parallel ones. Within
/// its share, L and the path are taken at two points, one standard deviation of what is left of
/// the lobe to both sides along the tilt, where they change fast (they are exact to third order).
/// Occluders hide their own shares of the lobe from the object. Those between source and relay are
/// not asked.
class LobeField {
 public:
  LobeField(const Scene& scene, const SensorPlacement& placement);

  /// Edges as a point sees them, made once for all directions.
  class View {
   public:
    /// About the unit vector `direction` (object to relay), from what lights zone `zone`.
    GatheredLight about(const Eigen::Vector3d& direction, int zone) const;

   private:
    friend class LobeField;
    struct Edge {
      Eigen::Vector3d inward;  ///< unit normal of the plane through the object and the edge
    };
    struct Polygon {
      int zone = -1;  ///< that lights it; -1: all
      double albedo = 0;
      Eigen::Vector3d normal, point;
      std::size_t first = 0, end = 0;  ///< edges
    };
    Eigen::Vector3d origin_, source_;
    double sigma_ = 0;
    double intensity_ = 0;
    std::vector<Polygon> polygons_;
    std::vector<Polygon> occluders_;
    std::vector<Edge> edges_;

    void add_edges(const std::vector<Eigen::Vector3d>& corners, Polygon& polygon);
    bool cut(const Polygon& polygon, const Eigen::Vector3d& direction, const Eigen::Vector3d& along,
             const Eigen::Vector3d& across, Strip& strip_along, Strip& strip_across) const;
    double hidden_share(const Eigen::Vector3d& direction, double distance,
                        const Eigen::Vector3d& along, const Eigen::Vector3d& across) const;
  };
  /// `origin` is a point of the object, m; `occluders` are what may stand before the relay.
  View seen_from(const Eigen::Vector3d& origin, const std::vector<OccluderFace>& occluders) const;

 private:
  struct LitPolygon {
    int zone = -1;
    double albedo = 0;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    std::vector<Eigen::Vector3d> corners;
  };
  Eigen::Vector3d source_;
  double sigma_ = 0;
  double intensity_ = 0;
  std::vector<LitPolygon> polygons_;
};

}  // namespace blindcorner
