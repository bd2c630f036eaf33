// SPDX-License-Identifier: Apache-2.0
/// Speeds at which a vehicle can stop before anything that may stand on its path.
///
/// Let an object stand where the vehicle would touch it at arc length c of its path, and let it be
/// visible from arc length s on. At s the vehicle drives on for the reaction time t_r and then
/// brakes with b, so that it stops m before the object if
///
///     s + v t_r + v^2 / (2 b) <= c - m,   v <= sqrt(2 b d + (b t_r)^2) - b t_r,   d = c - m - s
///
/// (on a straight line; in curves b is the braking that the friction circle leaves). An object that
/// is not yet in sight may come towards the vehicle with up to u. It then takes u (t_r + v / b) of
/// d until the vehicle stands (Shalev-Shwartz et al. 2017, "On a formal model of safe and scalable
/// self-driving cars", oncoming traffic without its own braking). An object that is not seen before
/// c - m demands a stop there. Before s there is no demand: at any earlier place the vehicle must
/// only be able to slow down to that speed by the time it reaches s, and the speed profile takes
/// care of that. So a place that is hidden now costs no speed if the next frames will show it in
/// time: this is the expected information of the next frames. (The argument of Orzechowski, Meyer
/// and Lauer 2018, "Tackling occlusions & limited sensor range with set-based safety verification",
/// with a probability in place of their set of everything that may be there.)
///
/// Whether an object stands there at all is known as a probability. A profile fails with the summed
/// probability of all objects for which it is too fast. Therefore any set of objects may be
/// disregarded whose probabilities sum to at most `risk`; the most speed is gained by disregarding
/// the objects that demand the lowest speeds. Each decision is made with this risk, given
/// everything known at its time.
///
/// The solver's next frames are not counted on: an object that the solver will find later is
/// treated until then like an object that direct sight will show too late. Counting on them would
/// help only if an answer came between the last place for comfortable braking and the last place
/// for hard braking.
#pragma once

#include <span>
#include <vector>

#include "blindcorner/planner/path/path.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"

namespace blindcorner {

/// An object that may stand on a path. Arc lengths are those of the vehicle's reference point, m.
struct Encounter {
  double probability = 0;  ///< that the object is there
  double contact = 0;      ///< the vehicle reaches this arc length without touching the object
  double sight = 0;        ///< the object is visible from here on; infinite: not before contact
};

struct SafeSpeedOptions {
  /// Probability that the path holds an object for which the vehicle could not stop: an upper bound
  /// of the probability of a collision.
  double risk = 0.005;
  /// From the moment at which an object could be seen to the moment at which the brakes act, s: one
  /// frame, and the delay of computer and brakes.
  double reaction_time = 0.15;
  /// Share of the friction limit (mu g) with which the vehicle then brakes; the friction circle
  /// deducts what curves need. The default is the share of a comfortable stop
  /// (SpeedProfileOptions::braking), with which the vehicle drives a plan to stop for a visible
  /// object.
  double braking = 0.5;
  /// u: largest speed at which an object out of sight may come towards the vehicle, m/s.
  double closing_speed = 0;
  double margin = 0.5;  ///< m, between the stopped vehicle and the object

  /// Throws Error naming the field.
  void validate() const;
};

/// Largest speeds at the samples that the encounters allow, m/s; infinity where they demand
/// nothing. `from` is the vehicle's arc length. Encounters with a contact before it are over, and
/// sights before it count as now. Of the samples behind the vehicle, at most the last one is
/// limited. Empty for an empty path. Throws Error for a number that is not finite (the sight may be
/// infinite) and for a probability outside [0, 1].
std::vector<double> safe_speed_limits(std::span<const PathPoint> path, const VehicleLimits& limits,
                                      std::span<const Encounter> encounters, double from,
                                      const SafeSpeedOptions& options = {});

/// Largest speeds at the samples, m/s, at which the steering follows the path from arc length
/// `from` on, with `curvature` (1/m) as the vehicle's present curvature. A vehicle that leaves its
/// path cannot use what it knows about the path. A change of the steering angle that the path makes
/// within l metres has l / v seconds, with four fifths of the steering rate. Infinite for vehicles
/// that turn on the spot.
std::vector<double> steerable_speeds(std::span<const PathPoint> path, const VehicleLimits& limits,
                                     double from, double curvature);

/// Sets the speeds to 0 from the last sample up to an arc length on: a vehicle that overshoots it
/// also stops. Throws Error unless there is a speed for each sample and the arc length is a number.
void stop_at(std::span<const PathPoint> path, double arc_length, std::span<double> speeds);

}  // namespace blindcorner
