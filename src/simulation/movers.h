// SPDX-License-Identifier: Apache-2.0
/// Of what is known of hidden objects, what stands and what moves.
#pragma once

#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/control/traffic.h"
#include "blindcorner/planner/grid/hidden_motion.h"
#include "blindcorner/planner/grid/occupancy_grid.h"

namespace blindcorner {

/// An answer in two parts: a map holds what stands, traffic what moves, and each object of each
/// mode is in one of them.
struct StandingAndMoving {
  HiddenAnswer standing;      ///< the answer, without the objects that move
  std::vector<Mover> moving;  ///< at the time of the answer plus its age
};

/// An object moves where the root mean square of its speed is above half a metre a second: also one
/// whose velocity nobody knows yet, if the scene's motion lets it be fast. A mover's probability is
/// that of its mode, times what the answer adds to the scene's prior of presence as a share of the
/// doubt that the prior leaves; without any, the object stays where it is in the answer. `scene`:
/// as the map has it (shapes).
StandingAndMoving split_by_motion(const Scene& scene, const Motion& motion,
                                  const HiddenAnswer& answer);

}  // namespace blindcorner
