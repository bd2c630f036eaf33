// SPDX-License-Identifier: Apache-2.0
/// Keeps a vehicle on a path and at the speed of a profile.
#pragma once

#include <vector>

#include "blindcorner/planner/control/speed_profile.h"
#include "blindcorner/planner/path/path.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"

namespace blindcorner {

/// The published controller steers by the heading error to the path's first control point ahead,
/// proportional plus feed-forward, and sets the throttle likewise; its constants are not published.
/// Here a small lateral offset d obeys, along the path, d'' + gain/L (d' + d/L) = 0, with
/// L the control point's distance: damping sqrt(gain)/2, natural frequency sqrt(gain)/L.
struct PathFollowerOptions {
  double control_point_time = 0.6;      ///< the control point's distance over the speed, s
  double control_point_distance = 2.0;  ///< at least, m; less than a wheelbase turns back and forth
  double steering_gain = 2.5;           ///< damping 0.8
  double speed_gain = 2.0;              ///< 1/s: speed errors decay in 0.5 s
  double delay = 0.05;  ///< from the state that is read to half of its command's effect, s
  SpeedProfileOptions profile;

  void validate() const;
};

/// The defaults for cars; with a control point at 0.3 m, its length, for a robot that turns on the
/// spot.
PathFollowerOptions follower_options(const VehicleLimits& limits);

/// What the follower saw and wants.
struct FollowerOutput {
  DriveRequest request;
  double arc_length = 0;     ///< of the path's nearest point, m
  double offset = 0;         ///< of the vehicle from there, to the left, m
  double heading_error = 0;  ///< from the course to the control point, rad
  double target_speed = 0;   ///< m/s
  bool at_end = false;       ///< the path is driven and the vehicle stands
};

/// For one path; make a new one when the path changes.
class PathFollower {
 public:
  /// Throws Error for a path of fewer than two samples. `profile.start` is taken from `state`.
  PathFollower(std::vector<PathPoint> path, const VehicleLimits& limits, const VehicleState& state,
               const PathFollowerOptions& options = {});

  /// Call once a control period, in order: the nearest point is looked for ahead of the last one.
  FollowerOutput follow(const VehicleState& state);
  /// Plans the speed anew from where the vehicle is, within limits at the path's samples (m/s; of
  /// safe_speed.h; empty: none). A vehicle that is faster than they allow brakes until
  /// it is not. Throws Error unless there is one for each.
  void limit_speed(const std::vector<double>& limits, const VehicleState& state);
  /// The same steering, and the strongest braking that the friction circle leaves beside it.
  FollowerOutput stop(const VehicleState& state);

  /// m/s^2 that it asks for where the vehicle is on the path with a speed, steering aside.
  double acceleration_at(double arc_length, double speed) const {
    return acceleration(speed_command(arc_length, speed), speed);
  }

  const std::vector<PathPoint>& path() const { return path_; }
  const std::vector<double>& profile() const { return profile_; }  ///< m/s, at the samples

 private:
  /// What the profile asks for: a speed, and the acceleration with which that changes.
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
  bool limited_ = false;  ///< by limit_speed()
};

/// A stop where there is no path at all: friction limit, steering held at the present curvature.
DriveRequest safe_stop(const VehicleState& state, const VehicleLimits& limits);

}  // namespace blindcorner
