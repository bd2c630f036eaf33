// SPDX-License-Identifier: Apache-2.0
/// Terms of the light that a given scene needs, decided before any evaluation.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Face of an occluder.
struct OccluderFace {
  std::array<Eigen::Vector3d, 4> corners;
  bool one_sided = false;  ///< face of a closed body: counts only when seen from outside
};

/// How light is summed by way of the hidden object.
enum class Kernel {
  lambertian,    ///< incoming and outgoing light are two separate sums
  brdf_pairs,    ///< any other BRDF: sum over pairs of a way in and a way out
  retro_single,  ///< the lobe is small against the lit spot: only light about p = r counts
  retro_pairs    ///< the lobe is wide, or one sum misses the tolerance: sum over pairs of patches
};

/// Terms that some scenes need and others do not.
enum class Term {
  occlusion,       ///< shadows of known bodies between relay and object
  self_shadowing,  ///< shadows of the object on itself
  patch_pairs,  ///< each pair of a lit and a seen patch separately, not as a convolution or one sum
  dim_patches,  ///< relay patches that exchange almost no light with the search region
  whole_axis,   ///< the part of the time axis that light from the search region cannot reach
  object_in_view,  ///< the object in front of the sensor: seen directly, or blocking its view
  direct_return,   ///< direct return of the known surfaces
  known_bounces,   ///< two and three bounces within the known scene
  crosstalk,       ///< light of one zone that another zone records
  pile_up,         ///< detections lost behind earlier ones of the same pulse
  saturation       ///< bins that are full
};

/// One decision and its reason.
struct PlanDecision {
  Term term;
  std::string name;
  bool used = false;
  std::string reason;
  /// For a term that is left out: switching the term on changes no bin of any pose in the search
  /// region by more than this share of the pose's peak. 0: exactly nothing changes. Infinite: the
  /// scene does not say enough, or the term is missing where it matters.
  double bound = 0.0;
};

struct TransportPlan {
  Kernel kernel = Kernel::lambertian;
  std::vector<OccluderFace> occluders;  ///< faces that can stand between relay and search region
  std::vector<PlanDecision> decisions;

  /// The decision about a term. Throws Error when nothing was decided about the term.
  const PlanDecision& decision(Term term) const;
  /// Adds a decision, or replaces the decision about the same term.
  void decide(PlanDecision made);
};

/// Terms switched on or off against the plan's own decision, to measure what a decision costs or
/// saves. Correct light needs no overrides: the plan decides from the scene.
struct PlanOverrides {
  std::vector<Term> on, off;

  bool switched_on(Term term) const;
  bool switched_off(Term term) const;
};

/// Corner and middle placements of one object's search region: every combination of lower, middle
/// and upper values of its unknowns. They serve to judge spreads and gates before any pose is
/// known.
std::vector<Placement> probe_placements(const Scene& scene, int object = 0);

/// Points (m) that span an object's search region: corners of boxes around the object at the probed
/// placements. Every point of the object's surface lies within the convex hull of these points.
std::vector<Eigen::Vector3d> search_region_corners(const Scene& scene, int object = 0);

/// The unknowns, with position ranges cut to the part of the search region near the relay. Around
/// the region's point nearest to the middle of a relay surface, this part extends twice the
/// distance from that middle along each axis (at least twice the object's radius), m. Light and its
/// detail are in this part. Nothing where no range of a position is larger than the part.
std::optional<std::vector<Unknown>> ranges_near_relay(const Scene& scene);

/// Whether every free component of an object's placement except yaw lies in the range of its
/// unknown. The plan holds there.
bool in_search_region(const Scene& scene, const Placement& placement, int object = 0);

/// Kernel for a scene's material and for the lit and seen parts of the relay, given as for
/// make_plan.
Kernel choose_kernel(const Scene& scene, const std::vector<Eigen::Vector3d>& relay_points,
                     double lit_extent, const PlanOverrides& overrides = {});

/// Those of the occluder `faces` that can stand between the relay points and the search region.
std::vector<OccluderFace> occluders_between(const Scene& scene,
                                            const std::vector<OccluderFace>& faces,
                                            std::vector<Eigen::Vector3d> relay_points);

/// Decides the plan. `relay_points` are points on the relay that span its lit and seen parts;
/// `lit_extent` is the diameter of the lit spot in m. The models add decisions that depend on the
/// sensor's place or on the sampling.
TransportPlan make_plan(const Scene& scene, const std::vector<Eigen::Vector3d>& relay_points,
                        double lit_extent, const PlanOverrides& overrides = {});

/// Adds the decision about the object itself standing in front of the sensor. `seen` are the
/// source, the detector and points on the relay; their convex hull holds everything between source
/// or detector and the relay.
void decide_view(TransportPlan& plan, const Scene& scene, const std::vector<Eigen::Vector3d>& seen);

/// Faces of the hidden body itself, as occluders of its own light. A curved shape is replaced by a
/// polyhedron inside the shape.
std::vector<OccluderFace> body_faces(const Shape& shape, const Transform& T_world_shape,
                                     double size);

}  // namespace blindcorner
