// SPDX-License-Identifier: Apache-2.0
/// The fast model of one hidden object: how it is sampled (fast_sampling.cpp) and what it makes of
/// that (fast_model.cpp).
#pragma once

#include <algorithm>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "blindcorner/forward/transport/forward_model.h"
#include "forward/relay/moving_bodies.h"
#include "forward/relay/relay_setup.h"
#include "forward/transport/lobe_field.h"
#include "forward/transport/patch_light.h"
#include "forward/transport/path_grid.h"

namespace blindcorner {

/// Share of the light, in units of the tolerance, below which dim patches are left out together.
constexpr double kNegligible = 0.03;

class FastModel final : public ForwardModel {
 public:
  FastModel(const Scene& scene, const SensorPlacement& placement, const FastModelOptions& options);

  using ForwardModel::three_bounce;
  void three_bounce(const PoseVector& pose, HistogramCube& out) const override {
    render(place(scene_.hidden.placement, scene_.unknowns, pose), {}, out);
  }
  /// The same for a placement of the object, with other bodies in the way.
  void render(const Placement& placement, const MovingBodies& bodies, HistogramCube& out) const;
  const HistogramCube& direct_return() const override;
  const TransportPlan& plan() const override { return plan_; }
  std::optional<Fidelity> fidelity() const override { return fidelity_; }
  std::optional<ModelSize> size() const override {
    return ModelSize{lit_.size(), seen_.size(), object_nodes_};
  }

 private:
  using Shadows = std::vector<ShadowView>;  // one per node; empty without occluders

  struct Limits {
    double spread;        ///< m, path spread that one Gaussian may stand for
    double aspect;        ///< edge against distance of a cell with Gauss nodes
    double midpoint;      ///< the same where the centre alone will do
    double rule_spread;   ///< m, standard deviation of the path between two points of a rule
    double relay_angle;   ///< distance of two points of a rule against how far away they are
    double object_angle;  ///< the same of the object
  };
  Limits limits(double tolerance, double coarseness) const;
  void choose_fidelity(const FastModelOptions& options);
  void sample(double tolerance);
  std::vector<HistogramCube> render_probes(const std::vector<PoseVector>& poses);
  double choose_sampling(const std::vector<PoseVector>& poses, double tolerance);
  void compare_with_pairs(const std::vector<PoseVector>& poses, double tolerance);
  void take_pairs(const std::string& reason);
  bool single_sum() const { return plan_.kernel == Kernel::retro_single; }
  double pair_count() const { return 1.0 * lit_.size() * seen_.size() * object_nodes_; }
  bool pairs_resolve_lobe(double coarseness, double tolerance) const;
  bool too_many_pairs(double most) const;
  bool arrives_at_once(double tolerance) const;
  void decide_bounces(double tolerance);
  struct Choice {
    double coarseness;
    double change;  ///< of a bin by going on to twice as many cells, as a share of the peak
  };
  Choice coarsest(const std::vector<PoseVector>& poses, double tolerance, double most_pairs,
                  const std::function<int(double)>& sample);
  std::vector<PoseVector> probe_poses() const;
  static double largest_change(const std::vector<HistogramCube>& coarse,
                               const std::vector<HistogramCube>& fine);
  void complete_plan(double tolerance);
  static std::string two_digits(double value);  ///< for reasons
  double single_sum_bound() const;
  std::pair<int, int> reachable_bins() const;
  void sample_relay(const Limits& limits, double tolerance);
  void sample_object(const Limits& limits);
  /// Whether any seen patch may lie on the front side of an object point.
  bool faces_relay(const Eigen::Vector3d& center, const Eigen::Vector3d& normal) const {
    return std::any_of(seen_.blocks.begin(), seen_.blocks.end(), [&](const auto& block) {
      return normal.dot(block.center - center) > -block.radius;
    });
  }
  void lambertian(const SurfacePoint& point, const ShadowView* shadows, Scratch& s) const;
  void pair_with_one(double scale, Scratch& s) const;
  void all_pairs(double scale, Scratch& s) const;
  void retro_single(const CellNodes& cell, std::size_t anchor, const Shadows& shadows,
                    std::span<const std::vector<OccluderFace>> occluders, Scratch& s) const;
  void sample_anchors(double edge);
  std::vector<SurfacePoint> anchors_of(const std::vector<SurfaceCell>& cells) const;
  void inner_legs(Scratch& s) const;
  LobeRays lobe_rays(const Eigen::Vector3d& normal, const Scratch& s) const;
  void for_each_zone(const std::function<void(int, std::size_t, std::size_t)>& visit) const;
  void gather(const SurfacePoint& anchor, LobeLight& light, Scratch& s) const;
  void shade_lobes(const SurfacePoint& node, const std::vector<OccluderFace>& occluders,
                   Scratch& s) const;
  static void shade_patch(std::size_t i, std::size_t patch, Scratch& s);
  void see_ends(const SurfacePoint& node, const PatchArrays& a, const ShadowView* shadows,
                const CellNodes& cell, Scratch& s, LobeEnds& ends) const;
  void retro_pairs(const CellNodes& cell, const Shadows& shadows, Scratch& s) const;
  void light_between(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView* shadows,
                     Scratch& s) const;
  void shade_patches(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView* shadows,
                     Scratch& s) const;
  void shade(const SurfacePoint& node, const PatchArrays& arrays, const ShadowView& shadows,
             int patch, Scratch& s) const;
  static Scratch& own_scratch();  ///< of the thread
  void add_pulses(Scratch& s, int zone, std::size_t begin, std::size_t end) const;
  void add_seen_pulses(Scratch& s) const;
  void flush(Scratch& s) const;
  void render_points(const Placement& placement, const Transform& T,
                     const std::vector<OccluderFace>& occluders, const MovingBodies& bodies,
                     Scratch& s) const;
  void render_cells(const Placement& placement, const Transform& T,
                    const std::vector<OccluderFace>& occluders, const MovingBodies& bodies,
                    Scratch& s) const;
  std::vector<OccluderFace> own_occluders(const Placement& placement, const Transform& T) const;

  Scene scene_;
  PlanOverrides overrides_;
  RelaySetup setup_;
  TransportPlan plan_;
  std::vector<OccluderFace> all_occluders_;  ///< for poses outside of the search region
  std::optional<LobeField> lobe_;            ///< of the single sum
  bool confocal_;
  double pulse_sigma_;     ///< m of path, pulse, bin and extra blur together
  double extra_variance_;  ///< s^2
  bool bounces_ = false;   ///< light that bounces on within the known scene matters
  double object_edge_ = 1.0;
  int dim_patches_ = 0;   ///< left out
  int object_nodes_ = 0;  ///< of the scene's own placement
  /// [cell] which anchor's lobes stand for its own: cells near each other on one side of the
  /// object.
  std::vector<std::size_t> anchor_;
  std::size_t anchors_ = 0;
  double near_share_ = 1;         ///< of all pairs of patches: those within a lobe's reach
  double unresolved_ = 0;         ///< change of a bin where the search for a sampling gave up
  bool object_midpoint_ = false;  ///< cells are so small that their centres will do
  Fidelity fidelity_;
  PulseTable pulses_;
  std::optional<PathGrid> grid_;      ///< of a Lambertian object
  bool one_arrival_ = false;          ///< all light of a lit set reaches a point of it at once
  std::vector<SurfacePoint> points_;  ///< of a Lambertian object, in its own coordinates
  mutable std::once_flag direct_once_;
  mutable HistogramCube direct_;
  PatchArrays lit_;    ///< of the flash field, or of all zones one after the other (confocal)
  PatchArrays seen_;   ///< of all zones, one after the other
  PatchArrays relay_;  ///< what is lit, then what is seen
  int axis_bins_;
  double bins_per_metre_;
  double cells_per_metre_;
  int path_cells_;
};

}  // namespace blindcorner
