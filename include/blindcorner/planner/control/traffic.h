// SPDX-License-Identifier: Apache-2.0
/// What moves, where it will be, and how hard a vehicle has to brake for it.
///
/// A mover's pose p and velocity v are known as normal distributions; at a time t it is at
/// p + v t + w, with w the random walk of its velocity, of variance q t^3 / 3. Samples of p, v and
/// w are driven on beside the vehicle on its path, so that what is counted is the probability that
/// the two ever touch: of places at one time, not of cells.
///
/// The vehicle goes on as its path's speeds say while that probability is at most the risk that is
/// taken. Else it needs the least deceleration with which it is. While that is gentle there is
/// time: the next frames will tell more, and what is feared may have passed. From `comfortable` on
/// it brakes, as hard as it has to, up to the friction limit; and where not even that is enough,
/// such that the squared speed of impact, which is what an impact does, is expected to be least.
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
  double risk = 0.02;         ///< probability of touching something that is taken at each decision
  double comfortable = 0.35;  ///< share of the friction limit from which on the vehicle brakes
  double reaction_time = 0.05;  ///< s until brakes act (PathFollowerOptions::delay)
  double horizon = 5;           ///< s that are looked ahead
  double margin = 0.3;          ///< m that are kept from movers

  /// Throws Error naming the field.
  void validate() const;
};

/// What a vehicle has to do for movers.
struct TrafficDecision {
  double braking = 0;      ///< share of the friction limit; 0: it goes on
  double probability = 0;  ///< of touching a mover, if it went on
  double time = 0;         ///< s until then, mean over what it would touch
  std::string mover;       ///< the likeliest of them; empty: none
};

/// For a vehicle that is at `state` on its follower's path. `body`: without a margin. Samples are
/// the same at every call. Throws Error for options out of range.
TrafficDecision decide_for_traffic(const PathFollower& follower, const VehicleState& state,
                                   const VehicleFootprint& body, double friction,
                                   std::span<const Mover> movers,
                                   const TrafficOptions& options = {});

}  // namespace blindcorner
