// SPDX-License-Identifier: Apache-2.0
/// What a single track does with its settings.
#pragma once

#include "blindcorner/planner/vehicles/single_track_parameters.h"
#include "blindcorner/planner/vehicles/vehicle_state.h"

namespace blindcorner {

/// Steering rate that the steering gear follows: none into its stop (CommonRoad's rule).
double possible_steering_rate(const SingleTrackParameters& parameters, double angle, double rate);

/// Acceleration that engine and brakes follow. Above full_power_speed the engine's acceleration
/// falls with 1/speed; beyond the range of speeds there is none (CommonRoad's rule).
double possible_acceleration(const SingleTrackParameters& parameters, double speed,
                             double acceleration);

/// Steering angle, rad, at which the centre of gravity rolls along a curvature without slip. It
/// holds also with slip if both axles' tyres are alike: the axles share load and lateral force in
/// the same proportion, so that slip angles are equal and cancel.
double steering_angle_for(const SingleTrackParameters& parameters, double curvature);

/// Settings that reach a request's curvature within `dt` and do not drive past standstill.
VehicleCommand single_track_command(const SingleTrackParameters& parameters, double speed,
                                    double steering_angle, const DriveRequest& request, double dt);

/// Limits with `friction` = mu g in m/s^2.
VehicleLimits single_track_limits(const SingleTrackParameters& parameters, double friction);

/// The acceleration, limited so that the vehicle comes to rest and does not reverse within `dt`.
double without_reversing(double acceleration, double speed, double dt);

}  // namespace blindcorner
