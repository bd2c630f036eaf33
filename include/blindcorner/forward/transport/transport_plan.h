// SPDX-License-Identifier: Apache-2.0
/// What a given scene needs, decided before anything is evaluated.
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

/// How light is carried by way of the hidden object.
enum class Kernel {
  lambertian,    ///< light arriving and light leaving are two separate sums
  retro_single,  ///< the lobe is small against the lit spot: light about p = r counts
  retro_pairs    ///< the lobe is wide, or one sum misses the tolerance: pairs of patches
};

/// Terms that one scene needs and another does not.
enum class Term {
  occlusion,       ///< shadows of known bodies between relay and object
  self_shadowing,  ///< shadows of the object on itself
  patch_pairs,  ///< every pair of a lit and a seen patch by itself, not as a convolution or one sum
  dim_patches,  ///< relay patches that exchange next to no light with the search region
  whole_axis,   ///< the time axis outside what light from the search region can reach
  object_in_view,  ///< the object before the sensor: seen directly, or blocking its view
  direct_return,   ///< light of the known surfaces
  known_bounces,   ///< two and three bounces within the known scene
  crosstalk,       ///< light of one zone that another records
  pile_up,         ///< detections lost behind earlier ones of the same pulse
  saturation       ///< bins that can hold no more
};

/// One decision and why it was taken.
struct PlanDecision {
  Term term;
  std::string name;
  bool used = false;
  std::string reason;
  /// Of a term that is left out: no bin of any pose in the search region changes by more than this
  /// share of the pose's peak when it is switched on. 0: exactly nothing changes; infinite: the
  /// scene does not say enough, or the term is missing where it matters.
  double bound = 0.0;
};

struct TransportPlan {
  Kernel kernel = Kernel::lambertian;
  std::vector<OccluderFace> occluders;  ///< faces that can stand between relay and search region
  std::vector<PlanDecision> decisions;

  /// Throws Error when nothing was decided about the term.
  const PlanDecision& decision(Term term) const;
  /// Adds a decision, or replaces the one about the same term.
  void decide(PlanDecision made);
};

/// Terms switched against the plan's own decision, to measure what a decision costs or saves.
/// Nobody has to know of this to get the right light: the plan decides from the scene.
struct PlanOverrides {
  std::vector<Term> on, off;

  bool switched_on(Term term) const;
  bool switched_off(Term term) const;
};

/// Corner and mid placements of one object's search region (every combination of lower, middle and
/// upper values of its unknowns), for judging spreads and gates before any pose is known.
std::vector<Placement> probe_placements(const Scene& scene, int object = 0);

/// Points (m) that span an object's search region: corners of boxes around it at the probed
/// placements. Every point of its surface lies within their convex hull.
std::vector<Eigen::Vector3d> search_region_corners(const Scene& scene, int object = 0);

/// The unknowns with the ranges of the part of the search region that is near the relay: within
/// twice its distance from there, m. Light and its detail are in that part. Nothing where no range
/// of a position is larger than that.
std::optional<std::vector<Unknown>> ranges_near_relay(const Scene& scene);

/// Whether every free component of an object's placement lies in the range of its unknown: the plan
/// holds there.
bool in_search_region(const Scene& scene, const Placement& placement, int object = 0);

/// Kernel for a scene's material and for what is lit and seen of the relay, as for make_plan.
Kernel choose_kernel(const Scene& scene, const std::vector<Eigen::Vector3d>& relay_points,
                     double lit_extent, const PlanOverrides& overrides = {});

/// Which of the scene's occluder faces can stand between the relay points and the search region.
std::vector<OccluderFace> occluders_between(const Scene& scene,
                                            const std::vector<OccluderFace>& faces,
                                            std::vector<Eigen::Vector3d> relay_points);

/// Decides the plan. `relay_points` are points on the relay that span what is lit and seen;
/// `lit_extent` is the diameter of the lit spot in m. Decisions that depend on the sensor's place
/// or on the sampling are added by the models.
TransportPlan make_plan(const Scene& scene, const std::vector<Eigen::Vector3d>& relay_points,
                        double lit_extent, const PlanOverrides& overrides = {});

/// Adds the decision about the object itself standing before the sensor. `seen` are points whose
/// hull holds everything between source or detector and the relay: both, and points on the relay.
void decide_view(TransportPlan& plan, const Scene& scene, const std::vector<Eigen::Vector3d>& seen);

/// Faces of the hidden body itself, as occluders of its own light. Curved shapes are replaced by a
/// polyhedron inside of them.
std::vector<OccluderFace> body_faces(const Shape& shape, const Transform& T_world_shape,
                                     double size);

}  // namespace blindcorner
