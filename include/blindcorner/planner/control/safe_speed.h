// SPDX-License-Identifier: Apache-2.0
/// Speeds at which a vehicle can stop before whatever may stand on its path.
///
/// Let an object stand where the vehicle would touch it at arc length c of its path, and let it be
/// seen from arc length s on. At s the vehicle drives on for the reaction time t_r and then brakes
/// with b, so that it stops m before the object if
///
///     s + v t_r + v^2 / (2 b) <= c - m,   v <= sqrt(2 b d + (b t_r)^2) - b t_r,   d = c - m - s
///
/// (on a straight line; in curves b is what the friction circle leaves). One that is hidden at s
/// may come towards the vehicle with up to u, and so takes u (t_r + v / b) of d until the vehicle
/// stands (Shalev-Shwartz et al. 2017, "On a formal model of safe and scalable self-driving cars",
/// oncoming traffic without its own braking). An object that is not seen
/// before c - m asks for a stop there. Nothing is asked before s: at any earlier place the vehicle
/// need only be able to slow down to that speed by the time it gets to s, which the speed profile
/// sees to. So a place that is hidden now costs no speed where the next frames will show it in
/// time: that is the expected information of the next frames. (The argument of Orzechowski, Meyer
/// and Lauer 2018, "Tackling occlusions & limited sensor range with set-based safety verification",
/// with a probability in place of their set of all that may be there.)
///
/// Whether an object stands there at all is known as a probability. A profile fails with the
/// probability of all those objects for which it is too fast, so what may be disregarded is any set
/// of them whose probabilities sum to at most `risk`; the most speed is won with those that ask for
/// the lowest. Each decision is made with this risk, given all that is known at its time.
///
/// What a solver's next frames may show is not counted on: an object that it will find later is
/// in the way until then, as one that direct sight will show too late. It would win something only
/// where an answer came between the last place for comfortable braking and that for hard braking.
#pragma once

#include <span>
#include <vector>

#include "blindcorner/planner/path/path.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"

namespace blindcorner {

/// Something that may stand on a path. Arc lengths are those of the vehicle's reference point, m.
struct Encounter {
  double probability = 0;  ///< that it is there
  double contact = 0;      ///< the vehicle comes so far without touching it
  double sight = 0;        ///< from here on it is seen; infinite: never before it is touched
};

struct SafeSpeedOptions {
  /// Probability that something is on the path for which the vehicle could not stop: that of a
  /// collision, at most.
  double risk = 0.005;
  /// From the moment in which something could be seen to the moment in which brakes act, s: a
  /// frame, and what computer and brakes take.
  double reaction_time = 0.15;
  /// Share of the friction limit (mu g) with which the vehicle then brakes; the friction circle
  /// takes what curves need. That of a comfortable stop (SpeedProfileOptions::braking), which is
  /// what a plan to stop for an object that is seen is driven with.
  double braking = 0.5;
  /// u: how fast what is not in sight may come towards the vehicle, m/s.
  double closing_speed = 0;
  double margin = 0.5;  ///< m, between the vehicle that has stopped and the object

  /// Throws Error naming the field.
  void validate() const;
};

/// Largest speeds at the samples that the encounters allow, m/s; infinity where they ask for
/// nothing. `from` is the vehicle's arc length: encounters with a contact before it are over,
/// sights before it are now. Samples behind it are not limited. Empty for an empty path. Throws
/// Error for a number that is not one (sight may be infinite) and a probability outside [0, 1].
std::vector<double> safe_speed_limits(std::span<const PathPoint> path, const VehicleLimits& limits,
                                      std::span<const Encounter> encounters, double from,
                                      const SafeSpeedOptions& options = {});

/// Largest speeds at the samples, m/s, at which the steering follows the path from arc length
/// `from` on, with `curvature` (1/m) as the vehicle turns now. Who leaves its path has nothing of
/// what it knows about it. A change of the steering angle that the path makes within l metres has
/// l / v seconds, with four fifths of the steering's rate. Infinite for vehicles that turn on the
/// spot.
std::vector<double> steerable_speeds(std::span<const PathPoint> path, const VehicleLimits& limits,
                                     double from, double curvature);

/// Sets the speeds to 0 from the last sample before an arc length on: a vehicle that overshoots it
/// stops too. Throws Error unless there is a speed for each sample.
void stop_at(std::span<const PathPoint> path, double arc_length, std::span<double> speeds);

}  // namespace blindcorner
