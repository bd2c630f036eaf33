// SPDX-License-Identifier: Apache-2.0
/// Hints about problems that a scene file or a result does not show by itself. Each hint is a
/// sentence that says what to do.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/forward/transport/forward_model.h"
#include "blindcorner/inverse/fit.h"

namespace blindcorner {

/// Shares (0 to 1) of the places of a search region that no zone can see.
struct RegionReach {
  double behind = 0;  ///< behind all lit and seen parts of the relay
  double early = 0;   ///< all light comes before the first bin that is used
  double late = 0;    ///< all light comes after the last bin that is used
  std::string relay;  ///< names of the relay surfaces that are lit and seen

  double unseen() const { return behind + early + late; }
};

/// Shares over places on a lattice of the unknown coordinates of one object, from the geometry
/// alone. Occlusion by known bodies is ignored, and so is the side that the object turns away from
/// the relay.
RegionReach region_reach(const Scene& scene, const SensorPlacement& sensor, int object = 0);

/// The same for one placement of each object. The result is that of the worst placement.
RegionReach placement_reach(const Scene& scene, const SensorPlacement& sensor,
                            const std::vector<Placement>& placements);

/// Hints about a scene before there is a capture: parts of the search region in which nothing can
/// be found. Empty: no hints.
std::vector<std::string> scene_hints(const Scene& scene, const SensorPlacement& sensor);

/// Hints about objects that are placed somewhere on purpose.
std::vector<std::string> placement_hints(const Scene& scene, const SensorPlacement& sensor,
                                         const std::vector<Placement>& placements);

/// Hints about a fit whose light the scene cannot explain, as when gains were never calibrated, and
/// about a position that an unchecked time zero may shift.
std::vector<std::string> fit_hints(const Scene& scene, const FitResult& result);

}  // namespace blindcorner
