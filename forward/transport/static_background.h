// SPDX-License-Identifier: Apache-2.0
/// Light of the known scene itself for the fast model. A fit needs it anew for each sensor pose.
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

/// How finely light that bounces within the known scene is sampled. Cells get smaller as their
/// distance to the facing surfaces falls, down to a least edge. The values are by judgement of
/// time: their error is measured against a coarser sampling and carried in the likelihood.
struct StaticLightSampling {
  int zone_divisions = 1;       ///< least number of two-bounce patches along each side of a zone
  int outer_divisions = 2;      ///< the same for three-bounce patches
  int field_divisions = 8;      ///< least number of patches along each side of the field
  double patch_angle = 0.4;     ///< edge of two-bounce patches relative to that distance
  double least_patch = 4;       ///< their least edge, in standard deviations of the pulse's path
  double outer_angle = 2.0;     ///< edge of three-bounce patches relative to that distance
  double part_angle = 0.15;     ///< edge of a part that stands for several patches, relative to its
                                ///< distance from the cells that exchange light with it: adds 1 to
                                ///< 5 % to the squared error
  double middle_angle = 0.45;   ///< edge of the middle cells relative to that distance
  double middle_edge = 0.12;    ///< their largest edge relative to the largest surface's extent
  double least_middle = 0.008;  ///< their least edge relative to that extent
};

/// The sampling with all divisions multiplied by `by` and all edges divided by `by`.
StaticLightSampling denser(StaticLightSampling sampling, double by);

/// Faces of a placed body. They hide whatever is behind them.
std::vector<OccluderFace> known_faces(const Shape& shape, const Transform& T_world_shape,
                                      double size);

/// Faces of all hidden objects at a pose. They hide whatever is behind them.
std::vector<OccluderFace> hidden_faces(const Scene& scene, const PoseVector& pose);

/// Two and three bounces within the known scene, smooth in the sensor's pose. Patches of the known
/// surfaces exchange light. The light's paths spread over the patches' extent, so that coarse
/// patches give no comb. A middle cell gathers its light in one histogram, and each zone's patches
/// then delay that histogram.
///
/// Two things are computed once for a scene: a tree of middle cells, fine enough for any patch, and
/// the list of faces that can hide something. Two are computed for each sensor pose: the patches of
/// the light and of the zones, and the choice of tree cells that are fine enough for these patches.
class KnownBounces {
 public:
  explicit KnownBounces(const Scene& scene, const StaticLightSampling& sampling = {});

  /// Whether any two reflecting surfaces face each other.
  bool any() const { return !middle_.empty(); }
  /// Number of legs between patches and middle cells. Three bounces would cost this many if no part
  /// of a tree stood for several patches.
  std::size_t legs(const RelaySetup& setup) const;
  /// Adds the light of two and three bounces to the cube, W/m^2 per bin. `bodies` block some of it.
  void add(const RelaySetup& setup, const PulseTable& pulses, HistogramCube& cube,
           const std::vector<OccluderFace>& bodies = {}) const;

  struct TimeRows;  ///< light of each zone by path
  /// A piece of a known surface.
  struct Piece {
    std::size_t surface;
    SurfaceCell cell;
  };

 private:
  /// An area that scatters as if from its centre.
  struct Element {
    SurfaceCell cell;
    double scattered;  ///< area times albedo over pi
    ShadowView shadows;
  };
  struct Middle {
    Piece piece;
    double edge = 0;                ///< m
    std::vector<Element> elements;  ///< the cell, or its parts between faces that stand across it
    std::size_t parts = 0;          ///< index of its first half; the second follows; 0: undivided
  };
  /// Patches that the field lights, or each zone by itself (confocal), and patches that zones see.
  struct Ends;
  static double distance(const Piece& piece, const std::vector<Piece>& faces);
  /// Largest edge of a middle cell at that distance from the nearest face that it faces.
  double allowed_edge(double distance) const;
  void add_middle(const Piece& piece);
  /// Least edge of the two-bounce patches, m.
  double least_patch() const;
  /// The coarsest middle cells that the lit and seen patches allow.
  std::vector<const Element*> middle_for(const Ends& ends) const;
  Ends ends_of_two(const RelaySetup& setup) const;
  Ends ends_of_three(const RelaySetup& setup) const;
  Ends ends(const RelaySetup& setup, int zone_divisions, double angle, double least) const;
  /// Adds one part of the sums. `blocks`: groups of seen patches that lie close together.
  void add_two(const Ends& ends, const std::vector<std::vector<std::size_t>>& blocks,
               const std::vector<OccluderFace>& blockers, std::size_t part, TimeRows& rows) const;
  void add_three(const Ends& ends, const std::vector<const Element*>& middle,
                 const std::vector<OccluderFace>& bodies, std::size_t part, TimeRows& rows) const;

  const Scene& scene_;
  StaticLightSampling sampling_;
  std::vector<OccluderFace> blockers_;
  std::vector<Piece> faces_;    // reflecting faces
  double largest_ = 0;          // m, extent of the largest reflecting surface
  std::vector<Middle> middle_;  // faces that face others, then their subdivisions
  std::size_t roots_ = 0;       // number of whole faces at the start of middle_
};

/// Light of the known scene for any sensor pose.
class StaticBackgroundModel {
 public:
  explicit StaticBackgroundModel(const Scene& scene);
  bool any_bounces() const { return bounces_.any(); }
  /// Whether the timely sampling is coarser than the usual one.
  bool any_coarser() const;
  /// Whether the fine sampling differs from the usual one.
  bool any_finer() const;
  /// Light in W/m^2 per bin, crosstalk included. Without `bounces` it is the direct return alone.
  /// `direct` receives the direct return in either case.
  HistogramCube light(const RelaySetup& setup, KnownLightSampling sampling, bool bounces,
                      HistogramCube& direct) const;
  /// Light of the bounces alone with `bodies` in their way, by the usual or a coarse sampling. The
  /// coarse one costs a tenth and tells roughly how much light the bodies block.
  HistogramCube bounces_behind(const RelaySetup& setup, const std::vector<OccluderFace>& bodies,
                               bool coarsely) const;
  /// Standard deviations of the model's own error in `light` and `direct`, both as light() returns
  /// them. Errors of neighbouring bins and zones are correlated and add up; the deviations are as
  /// large as independent errors of the bins would have to be for the same sum. The relative errors
  /// are measured once, at the scene's own placement.
  BackgroundError error(const HistogramCube& light, const HistogramCube& direct,
                        KnownLightSampling sampling) const;

 private:
  /// Light at the scene's own placement and its error.
  struct Own {
    double light = 0;  ///< sum over bins
    double share = 0;  ///< relative error
    /// Squared error in units of photon noise, up to a factor common to all light.
    double error() const { return share * share * light; }
  };
  using Sampling = KnownLightSampling;
  Own measured_direct(bool fine) const;
  Own measured_bounces(Sampling sampling) const;
  const Own& own_direct(bool fine) const;
  const Own& own_bounces(Sampling sampling) const;
  /// Whether the direct return's finer cells are worth their time.
  bool fine_direct(Sampling sampling) const;
  /// The sampling of the bounces for a wanted one: `usual` where they have no other.
  Sampling bounces_sampling(Sampling wanted) const;
  const KnownBounces& bounces_of(Sampling sampling) const;
  /// Bounces sampled more finely than usual; null where there are none or they cost too much.
  const KnownBounces* finer_bounces() const;
  const KnownBounces& coarser_bounces() const;
  const KnownBounces& shadow_bounces() const;

  const Scene& scene_;
  StaticLightSampling sampling_;
  KnownBounces bounces_;
  PulseTable pulses_;
  mutable std::once_flag finer_once_, coarser_once_, shadow_once_;
  mutable std::once_flag timely_once_;
  mutable bool coarser_is_timely_ = false;
  /// [0]: usual sampling, [1]: fine sampling.
  mutable std::array<std::once_flag, 2> direct_once_;
  mutable std::array<Own, 2> own_direct_;
  /// By KnownLightSampling.
  mutable std::array<std::once_flag, 3> bounces_once_;
  mutable std::array<Own, 3> own_bounces_;
  mutable std::unique_ptr<KnownBounces> finer_, coarser_, shadow_;
};

}  // namespace blindcorner
