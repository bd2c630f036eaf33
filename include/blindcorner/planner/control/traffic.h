// SPDX-License-Identifier: Apache-2.0
/// Moving objects: where they will be, and how hard a vehicle has to brake for them.
///
/// A mover's pose p and velocity v are known as normal distributions. At a time t it is at
/// p + v t + w, where w comes from the random walk of its velocity and has variance q t^3 / 3.
/// Samples of p, v and w move along with the vehicle on its path. So the result is the probability
/// that the vehicle and the mover ever touch: it compares places at the same time, not cells.
///
/// The vehicle keeps its path's speeds while that probability is at most the accepted risk.
/// Otherwise it needs the least deceleration that keeps the probability within the risk. While that
/// deceleration is gentle there is time: the next frames will tell more, and the danger may have
/// passed. From `comfortable` on the vehicle brakes as hard as necessary, up to the friction limit.
/// If even the friction limit is not enough, it minimises the expected squared speed of impact,
/// which measures the damage of an impact.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "blindcorner/planner/control/path_follower.h"
#include "blindcorner/planner/path/mover.h"

namespace blindcorner {

struct TrafficOptions {
  double risk = 0.02;           ///< probability of a touch that is accepted at each decision
  double comfortable = 0.35;    ///< share of the friction limit from which on the vehicle brakes
  double reaction_time = 0.05;  ///< s until brakes act (PathFollowerOptions::delay)
  double horizon = 5;           ///< s of the prediction
  double margin = 0.3;          ///< m, least distance kept from movers

  /// Throws Error naming the field.
  void validate() const;
};

/// How a vehicle has to react to movers.
struct TrafficDecision {
  double braking = 0;      ///< share of the friction limit; 0: the vehicle drives on
  double probability = 0;  ///< of touching a mover, if the vehicle drives on
  double time = 0;         ///< s until the touch, mean over the movers' samples that touch
  std::string mover;       ///< the mover most likely to be touched; empty: none
};

/// Decides for a vehicle at `state` on its follower's path. `body` has no margin. The samples are
/// the same at every call. Throws Error for options out of range.
TrafficDecision decide_for_traffic(const PathFollower& follower, const VehicleState& state,
                                   const VehicleFootprint& body, double friction,
                                   std::span<const Mover> movers,
                                   const TrafficOptions& options = {});

}  // namespace blindcorner
