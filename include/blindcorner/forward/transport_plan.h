// SPDX-License-Identifier: Apache-2.0
/// What a given scene needs, decided before anything is evaluated.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene.h"
#include "blindcorner/forward/visibility.h"

namespace blindcorner {

/// How light is carried by way of the hidden object.
enum class Kernel {
  lambertian,    ///< light arriving and light leaving are two separate sums
  retro_single,  ///< the lobe is small against the lit spot: only p = r counts
  retro_pairs    ///< the lobe is wide: pairs of lit and seen patches, weighted by the lobe
};

/// One decision and why it was taken.
struct PlanDecision {
  std::string term;
  bool used = false;
  std::string reason;
};

struct TransportPlan {
  Kernel kernel = Kernel::lambertian;
  std::vector<OccluderFace> occluders;  ///< faces that can stand between relay and search region
  std::vector<PlanDecision> decisions;
};

/// Corner and mid poses of the search region (every combination of lower, middle and upper values
/// of the unknowns), for judging spreads and gates before any pose is known.
std::vector<Placement> probe_placements(const Scene& scene);

/// Decides the plan. `relay_points` are points on the relay that span what is lit and seen;
/// `lit_extent` is the diameter of the lit spot in m.
TransportPlan make_plan(const Scene& scene, const std::vector<Eigen::Vector3d>& relay_points,
                        double lit_extent);

}  // namespace blindcorner
