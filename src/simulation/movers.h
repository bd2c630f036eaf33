// SPDX-License-Identifier: Apache-2.0
/// Splits an answer on hidden objects into standing and moving ones.
#pragma once

#include <vector>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/scene.h"
#include "blindcorner/planner/control/traffic.h"
#include "blindcorner/planner/grid/hidden_motion.h"
#include "blindcorner/planner/grid/occupancy_grid.h"

namespace blindcorner {

/// An answer in two parts. A map holds the standing objects, and the traffic holds the moving ones.
/// Each object of each mode is in one of the two.
struct StandingAndMoving {
  HiddenAnswer standing;      ///< the answer, without the objects that move
  std::vector<Mover> moving;  ///< at the time of the answer plus its age
};

/// An object moves if the root mean square of its speed is above half a metre a second. An object
/// of still unknown velocity also moves, if the scene's motion lets it be fast. A mover's
/// probability is that of its mode times a factor: the presence that the answer adds to the scene's
/// prior, as a share of the doubt that the prior leaves. If the answer adds none, the object stays
/// in the standing part. `scene` is the map's (shapes).
StandingAndMoving split_by_motion(const Scene& scene, const Motion& motion,
                                  const HiddenAnswer& answer);

}  // namespace blindcorner
