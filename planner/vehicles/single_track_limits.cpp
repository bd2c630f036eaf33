// SPDX-License-Identifier: Apache-2.0
#include "planner/vehicles/single_track_limits.h"

#include <algorithm>
#include <cmath>

#include "planner/require_positive.h"

namespace blindcorner {

double possible_steering_rate(const SingleTrackParameters& parameters, double angle, double rate) {
  const double stop = parameters.steering_angle;
  if ((angle <= -stop && rate <= 0) || (angle >= stop && rate >= 0)) return 0;
  return std::clamp(rate, -parameters.steering_rate, parameters.steering_rate);
}

double possible_acceleration(const SingleTrackParameters& parameters, double speed,
                             double acceleration) {
  const bool too_slow = speed <= parameters.speed_min && acceleration <= 0;
  const bool too_fast = speed >= parameters.speed_max && acceleration >= 0;
  if (too_slow || too_fast) return 0;
  const double most = parameters.acceleration;
  const double full_power = parameters.full_power_speed;
  const double engine = speed > full_power ? most * full_power / speed : most;
  return std::clamp(acceleration, -most, engine);
}

double steering_angle_for(const SingleTrackParameters& parameters, double curvature) {
  // The rear axle's radius is shorter: R_rear^2 = R^2 - rear_axle^2.
  const double offset = parameters.rear_axle * curvature;
  const double rear = std::sqrt(std::max(1 - offset * offset, 1e-6));
  const double angle = std::atan(parameters.wheelbase() * curvature / rear);
  return std::clamp(angle, -parameters.steering_angle, parameters.steering_angle);
}

VehicleCommand single_track_command(const SingleTrackParameters& parameters, double speed,
                                    double steering_angle, const DriveRequest& request, double dt) {
  const double rate = (steering_angle_for(parameters, request.curvature) - steering_angle) / dt;
  return {.acceleration = without_reversing(request.acceleration, speed, dt),
          .steering = std::clamp(rate, -parameters.steering_rate, parameters.steering_rate)};
}

VehicleLimits single_track_limits(const SingleTrackParameters& parameters, double friction) {
  const double wheelbase = parameters.wheelbase();
  const double rear_radius = wheelbase / std::tan(parameters.steering_angle);
  return {.speed = parameters.speed_max,
          .acceleration = parameters.acceleration,
          .friction = friction,
          .curvature = 1 / std::hypot(rear_radius, parameters.rear_axle),
          .steering_rate = parameters.steering_rate,
          .wheelbase = wheelbase};
}

double without_reversing(double acceleration, double speed, double dt) {
  return std::max(acceleration, std::min(0.0, -speed / dt));
}

void SingleTrackParameters::validate() const {
  const auto positive = [](const char* field, double value) {
    require_positive("SingleTrackParameters", field, value);
  };
  positive("length", length);
  positive("width", width);
  positive("mass", mass);
  positive("yaw_inertia", yaw_inertia);
  positive("front_axle", front_axle);
  positive("rear_axle", rear_axle);
  positive("gravity_center_height", gravity_center_height);
  positive("wheel_inertia", wheel_inertia);
  positive("wheel_radius", wheel_radius);
  positive("steering_angle", steering_angle);
  positive("steering_rate", steering_rate);
  positive("acceleration", acceleration);
  positive("full_power_speed", full_power_speed);
  positive("speed_max", speed_max);
}

}  // namespace blindcorner
