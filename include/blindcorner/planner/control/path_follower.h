// SPDX-License-Identifier: Apache-2.0
/// Keeps a vehicle on a path and at the speeds of a profile.
#pragma once

#include <vector>

#include "blindcorner/planner/control/speed_profile.h"
#include "blindcorner/planner/path/path.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"

namespace blindcorner {

/// The published controller steers by the heading error to the path's first control point ahead,
/// with proportional and feed-forward terms, and sets the throttle in the same way; its constants
/// are not published. Here a small lateral offset d obeys, along the path,
/// d'' + gain/L (d' + d/L) = 0, where L is the control point's distance: damping sqrt(gain)/2,
/// natural frequency sqrt(gain)/L.
struct PathFollowerOptions {
  double control_point_time = 0.6;      ///< distance of the control point divided by the speed, s
  double control_point_distance = 2.0;  ///< m, at least; below a wheelbase the steering oscillates
  double steering_gain = 2.5;           ///< damping 0.8
  double speed_gain = 2.0;              ///< 1/s: speed errors decay in 0.5 s
  double delay = 0.05;  ///< s, from reading the state until half of the command has taken effect
  SpeedProfileOptions profile;

  void validate() const;
};

/// The defaults for cars. For a robot that turns on the spot the control point is at 0.3 m, the
/// robot's length.
PathFollowerOptions follower_options(const VehicleLimits& limits);

/// What the follower measured and what it requests.
struct FollowerOutput {
  DriveRequest request;
  double arc_length = 0;     ///< m, of the path's nearest point
  double offset = 0;         ///< m, of the vehicle from that point, positive to the left
  double heading_error = 0;  ///< rad, from the course to the direction of the control point
  double target_speed = 0;   ///< m/s
  bool at_end = false;       ///< the path is driven and the vehicle stands (stop(): it stands)
};

/// Follows one path; make a new follower when the path changes.
class PathFollower {
 public:
  /// Throws Error for a path of fewer than two samples. `profile.start` is taken from `state`.
  PathFollower(std::vector<PathPoint> path, const VehicleLimits& limits, const VehicleState& state,
               const PathFollowerOptions& options = {});

  /// Call once per control period, in order: the search for the nearest point starts at the last
  /// one.
  FollowerOutput follow(const VehicleState& state);
  /// Plans the speed again from the vehicle's place, within limits at the path's samples (m/s, from
  /// safe_speed.h; empty: no limits). A vehicle that is faster than the limits brakes until it
  /// keeps them. Throws Error unless there is one limit for each sample.
  void limit_speed(const std::vector<double>& limits, const VehicleState& state);
  /// The same steering, with the strongest braking that the friction circle leaves beside it, at
  /// least 0.71 of the friction limit.
  FollowerOutput stop(const VehicleState& state);

  /// m/s^2 that the follower requests at a place of the path and a speed, apart from the steering.
  double acceleration_at(double arc_length, double speed) const {
    return acceleration(speed_command(arc_length, speed), speed);
  }

  const std::vector<PathPoint>& path() const { return path_; }
  const std::vector<double>& profile() const { return profile_; }  ///< m/s, at the samples

 private:
  /// The profile's speed at a place, and the acceleration with which that speed changes.
  struct SpeedCommand {
    double target = 0, feed_forward = 0;
  };
  SpeedCommand speed_command(double arc_length, double speed) const;
  double acceleration(const SpeedCommand& command, double speed) const;
  FollowerOutput steer(const VehicleState& state);

  std::vector<PathPoint> path_;
  VehicleLimits limits_;
  PathFollowerOptions options_;
  std::vector<double> profile_;
  double arc_length_ = 0;
  bool limited_ = false;  ///< limit_speed() has set limits
};

/// A stop without any path: it brakes at the friction limit and holds the present curvature. Below
/// 1 m/s (a robot: 0.05 m/s) it steers straight ahead.
DriveRequest safe_stop(const VehicleState& state, const VehicleLimits& limits);

}  // namespace blindcorner
