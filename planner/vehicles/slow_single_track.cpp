// SPDX-License-Identifier: Apache-2.0
#include "planner/vehicles/slow_single_track.h"

#include <cmath>

namespace blindcorner {

SlowDerivative slow_derivative(const SingleTrackParameters& parameters, const SlowMotion& motion) {
  const double wheelbase = parameters.wheelbase();
  const double rear = parameters.rear_axle / wheelbase;
  const double tangent = std::tan(motion.steering);
  const double per_cosine_2 = 1 + tangent * tangent;  // 1 / cos^2(steering)
  const double rolling_slip = std::atan(rear * tangent);
  const double v = motion.speed;

  SlowDerivative d;
  d.x = v * std::cos(motion.yaw + rolling_slip);
  d.y = v * std::sin(motion.yaw + rolling_slip);
  d.yaw = v * std::cos(rolling_slip) * tangent / wheelbase;
  // The exact derivative of rolling_slip has (rear tangent)^2 in the denominator. CommonRoad has
  // this square of the tangent's square, which is kept: the two agree to 1 % up to 0.18 rad.
  const double square = rear * tangent * tangent;
  d.slip_angle = rear * motion.steering_rate * per_cosine_2 / (1 + square * square);
  d.yaw_rate = (motion.acceleration * std::cos(motion.slip_angle) * tangent -
                v * std::sin(motion.slip_angle) * d.slip_angle * tangent +
                v * std::cos(motion.slip_angle) * motion.steering_rate * per_cosine_2) /
               wheelbase;
  return d;
}

}  // namespace blindcorner
