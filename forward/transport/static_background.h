// SPDX-License-Identifier: Apache-2.0
/// The known scene's own light for the fast model: what a fit needs anew for each sensor pose.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "blindcorner/forward/sensor/capture.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/forward/transport/transport_plan.h"
#include "forward/relay/relay_setup.h"
#include "forward/relay/visibility.h"

namespace blindcorner {

/// How finely the light that bounces on within the known scene is sampled. Cells get smaller with
/// their distance to what they face, down to a least edge. By judgement of time: what they leave
/// out is measured against a coarser sampling and carried in the likelihood.
struct StaticLightSampling {
  int zone_divisions = 1;       ///< patches of two bounces along each side of a zone, at least
  int outer_divisions = 2;      ///< the same of three bounces
  int field_divisions = 8;      ///< patches along each side of the field, at least
  double patch_angle = 0.4;     ///< edge of the patches of two bounces against that distance
  double least_patch = 4;       ///< their least edge in standard deviations of the pulse's path
  double outer_angle = 2.0;     ///< edge of the patches of three bounces against that distance
  double part_angle = 0.15;     ///< edge of what stands for several patches against the distance of
                                ///< what takes its light: adds 1 to 5 % to the squared error
  double middle_angle = 0.45;   ///< edge of the cells between these against that distance
  double middle_edge = 0.12;    ///< their largest edge against the largest surface's extent
  double least_middle = 0.008;  ///< their least edge against the same
};

/// The same with all edges divided by this.
StaticLightSampling denser(StaticLightSampling sampling, double by);

/// Faces of a placed body that hide what is behind them.
std::vector<OccluderFace> known_faces(const Shape& shape, const Transform& T_world_shape,
                                      double size);

/// Faces of all hidden objects at a pose, that hide what is behind them.
std::vector<OccluderFace> hidden_faces(const Scene& scene, const PoseVector& pose);

/// Two and three bounces within the known scene, smooth in the sensor's pose. Patches of the known
/// surfaces send each other light whose paths spread over their extent, so that coarse patches give
/// no comb. What a middle cell gathers is one histogram, which each zone's patches then delay.
///
/// Once for a scene: a tree of cells in the middle, fine enough for any patch, and which faces can
/// hide something. For a sensor pose: the light's and the zones' patches, and which cells of the
/// tree are fine enough for these.
class KnownBounces {
 public:
  explicit KnownBounces(const Scene& scene, const StaticLightSampling& sampling = {});

  /// Whether any two reflecting surfaces face each other.
  bool any() const { return !middle_.empty(); }
  /// Legs between patches and the cells in the middle, which three bounces would cost if no part of
  /// a tree stood for several patches.
  std::size_t legs(const RelaySetup& setup) const;
  /// Adds two and three bounces to the cube, W/m^2 per bin.
  /// `bodies` block some of them.
  void add(const RelaySetup& setup, const PulseTable& pulses, HistogramCube& cube,
           const std::vector<OccluderFace>& bodies = {}) const;

  struct TimeRows;  ///< light of each zone
  /// A piece of a known surface.
  struct Piece {
    std::size_t surface;
    SurfaceCell cell;
  };

 private:
  /// What scatters as from its middle.
  struct Element {
    SurfaceCell cell;
    double scattered;  ///< area times albedo over pi
    ShadowView shadows;
  };
  struct Middle {
    Piece piece;
    double edge = 0;                ///< m
    std::vector<Element> elements;  ///< itself, or its parts between the faces that stand across it
    std::size_t parts = 0;          ///< of the first of its halves, which are neighbours; 0: whole
  };
  /// Patches of the field, or of each zone's own (confocal), and of all zones.
  struct Ends;
  static double distance(const Piece& piece, const std::vector<Piece>& faces);
  /// Largest edge of a cell in the middle at that distance from what it faces.
  double allowed_edge(double distance) const;
  void add_middle(const Piece& piece);
  /// Least edge of the patches of two bounces, m.
  double least_patch() const;
  /// The coarsest cells that what the ends light and see allows.
  std::vector<const Element*> middle_for(const Ends& ends) const;
  Ends ends_of_two(const RelaySetup& setup) const;
  Ends ends_of_three(const RelaySetup& setup) const;
  Ends ends(const RelaySetup& setup, int zone_divisions, double angle, double least) const;
  /// One part of the sums.
  /// `blocks`: of seen patches that lie together.
  void add_two(const Ends& ends, const std::vector<std::vector<std::size_t>>& blocks,
               const std::vector<OccluderFace>& blockers, std::size_t part, TimeRows& rows) const;
  void add_three(const Ends& ends, const std::vector<const Element*>& middle,
                 const std::vector<OccluderFace>& bodies, std::size_t part, TimeRows& rows) const;

  const Scene& scene_;
  StaticLightSampling sampling_;
  std::vector<OccluderFace> blockers_;
  std::vector<Piece> faces_;    // reflecting ones
  double largest_ = 0;          // m, extent of the largest of them
  std::vector<Middle> middle_;  // faces that face others, then what these may be divided into
  std::size_t roots_ = 0;       // how many of these faces
};

/// The known scene's light for any sensor pose.
class StaticBackgroundModel {
 public:
  explicit StaticBackgroundModel(const Scene& scene);
  bool any_bounces() const { return bounces_.any(); }
  /// Whether fine light differs from the usual one.
  bool any_finer() const;
  /// W/m^2 per bin, crosstalk included. Without `bounces` the direct return alone, which is handed
  /// out as well.
  HistogramCube light(const RelaySetup& setup, KnownLightSampling sampling, bool bounces,
                      HistogramCube& direct) const;
  /// The bounces alone with `bodies` in their way, by the usual sampling or by a coarse one, which
  /// costs a tenth and tells roughly how much the bodies take off.
  HistogramCube bounces_behind(const RelaySetup& setup, const std::vector<OccluderFace>& bodies,
                               bool coarsely) const;
  /// Standard deviations of the model's own error in `light` and `direct`, both as by light(), as
  /// large as if bins had errors of their own: those of neighbouring bins and zones go together,
  /// and add up. What the light does not tell is measured once, at the scene's own placement.
  BackgroundError error(const HistogramCube& light, const HistogramCube& direct,
                        KnownLightSampling sampling) const;

 private:
  /// Light at the scene's own placement and how far off it is.
  struct Own {
    double light = 0;  ///< sum over bins
    double share = 0;  ///< relative error
    /// In units of photon noise, but for a factor that all light has in common.
    double error() const { return share * share * light; }
  };
  using Sampling = KnownLightSampling;
  Own measured_direct(bool fine) const;
  Own measured_bounces(Sampling sampling) const;
  const Own& own_direct(bool fine) const;
  const Own& own_bounces(Sampling sampling) const;
  /// Whether the direct return's finer cells are worth their time.
  bool fine_direct(Sampling sampling) const;
  const KnownBounces& bounces_of(Sampling sampling) const;
  /// Finer than the usual ones; null where they cost too much.
  const KnownBounces* finer_bounces() const;
  const KnownBounces& coarser_bounces() const;
  const KnownBounces& shadow_bounces() const;

  const Scene& scene_;
  StaticLightSampling sampling_;
  KnownBounces bounces_;
  PulseTable pulses_;
  mutable std::once_flag finer_once_, coarser_once_, shadow_once_;
  /// Usual, fine.
  mutable std::array<std::once_flag, 2> direct_once_, bounces_once_;
  mutable std::array<Own, 2> own_direct_, own_bounces_;
  mutable std::unique_ptr<KnownBounces> finer_, coarser_, shadow_;
};

}  // namespace blindcorner
