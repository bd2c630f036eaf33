// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/single_track_drift.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "planner/vehicles/pacejka.h"
#include "planner/vehicles/single_track_limits.h"
#include "planner/vehicles/single_track_states.h"
#include "planner/vehicles/slow_single_track.h"

namespace blindcorner {
namespace {

/// Speeds of the wheels, rad/s, after what all single-track models have.
enum WheelState { kFront = kSingleTrackStates, kRear, kStates };

// The blend with the kinematic model, all of CommonRoad's STD.
constexpr double kBlendSpeed = 0.2;             ///< both models weigh the same, m/s
constexpr double kBlendWidth = 0.05;            ///< of the hyperbolic tangent, m/s
constexpr double kSlipSpeed = kBlendSpeed / 2;  ///< least speed that slip is taken of, m/s
constexpr double kRollingTime = 0.02;           ///< kinematic wheels reach the car's speed, s

struct Wheels {
  double front_speed = 0, rear_speed = 0;  ///< of the hubs along the wheels, m/s, >= 0
  Eigen::Vector2d front, rear;             ///< forces in the wheels' frames, N
};

class SingleTrackDrift : public VehicleModel {
 public:
  SingleTrackDrift(const SingleTrackParameters& parameters, const PacejkaTyre& tyre)
      : p_(parameters), tyre_(tyre) {
    p_.validate();
  }

  std::string name() const override { return "single_track_drift"; }
  std::vector<std::string> state_names() const override {
    std::vector<std::string> names = single_track_state_names();
    names.insert(names.end(), {"front_wheel_rad_per_s", "rear_wheel_rad_per_s"});
    return names;
  }
  VehicleRectangle footprint() const override { return {p_.length, p_.width, 0}; }
  VehicleLimits limits() const override { return single_track_limits(p_, tyre_.p_dy1 * kGravity); }

  StateVector initial(const VehicleState& state) const override {
    const double rolling = state.speed * std::cos(state.slip_angle) / p_.wheel_radius;
    StateVector x(kStates);
    x << single_track_initial(state), rolling * std::cos(state.steering_angle), rolling;
    return x;
  }

  VehicleState motion(const StateVector& x) const override { return single_track_motion(x); }

  StateVector derivative(const StateVector& x, const VehicleCommand& command) const override {
    const double rate = possible_steering_rate(p_, x[kSteering], command.steering);
    const double acceleration = possible_acceleration(p_, x[kSpeed], command.acceleration);
    const Wheels wheels = wheels_of(x, acceleration);
    StateVector fast(kStates), slow(kStates);
    fast_derivative(x, acceleration, wheels, fast);
    slow_derivative_of(x, rate, acceleration, wheels, slow);
    const double weight = 0.5 * (std::tanh((x[kSpeed] - kBlendSpeed) / kBlendWidth) + 1);
    StateVector dx = weight * fast + (1 - weight) * slow;
    dx[kX] = x[kSpeed] * std::cos(x[kYaw] + x[kSlip]);
    dx[kY] = x[kSpeed] * std::sin(x[kYaw] + x[kSlip]);
    dx[kSteering] = rate;
    // Wheels do not turn backwards. CommonRoad sets the tyre's part to zero below zero, where a
    // locked wheel ends up by rounding: it never turns again. Here it turns when the brake is let
    // go.
    for (const WheelState wheel : {kFront, kRear}) {
      if (x[wheel] <= 0) dx[wheel] = std::max(dx[wheel], 0.0);
    }
    return dx;
  }

  VehicleCommand command(const StateVector& x, const DriveRequest& request,
                         double dt) const override {
    return single_track_command(p_, x[kSpeed], x[kSteering], request, dt);
  }

 private:
  Wheels wheels_of(const StateVector& x, double acceleration) const {
    const double forwards = x[kSpeed] * std::cos(x[kSlip]);
    const double sideways = x[kSpeed] * std::sin(x[kSlip]);
    const double front_sideways = sideways + p_.front_axle * x[kYawRate];
    const double rear_sideways = sideways - p_.rear_axle * x[kYawRate];
    const bool rolls = x[kSpeed] > kSlipSpeed;
    const double front_angle = rolls ? std::atan(front_sideways / forwards) - x[kSteering] : 0;
    const double rear_angle = rolls ? std::atan(rear_sideways / forwards) : 0;

    Wheels wheels;
    wheels.front_speed =
        std::max(0.0, forwards * std::cos(x[kSteering]) + front_sideways * std::sin(x[kSteering]));
    wheels.rear_speed = std::max(0.0, forwards);
    const double shift = acceleration * p_.gravity_center_height;
    const double per_length = p_.mass / p_.wheelbase();
    wheels.front = pacejka_force(tyre_, slip(x[kFront], wheels.front_speed), front_angle,
                                 per_length * (kGravity * p_.rear_axle - shift));
    wheels.rear = pacejka_force(tyre_, slip(x[kRear], wheels.rear_speed), rear_angle,
                                per_length * (kGravity * p_.front_axle + shift));
    return wheels;
  }

  double slip(double wheel, double hub_speed) const {
    return 1 - p_.wheel_radius * std::max(0.0, wheel) / std::max(hub_speed, kSlipSpeed);
  }

  void fast_derivative(const StateVector& x, double acceleration, const Wheels& wheels,
                       StateVector& dx) const {
    const Eigen::Vector2d front = Eigen::Rotation2Dd(x[kSteering]) * wheels.front;
    // Along and across the course.
    const Eigen::Vector2d force = Eigen::Rotation2Dd(-x[kSlip]) * (front + wheels.rear);
    dx.setZero();
    dx[kSpeed] = force.x() / p_.mass;
    dx[kYaw] = x[kYawRate];
    dx[kYawRate] = (p_.front_axle * front.y() - p_.rear_axle * wheels.rear.y()) / p_.yaw_inertia;
    if (x[kSpeed] > kSlipSpeed) dx[kSlip] = force.y() / (p_.mass * x[kSpeed]) - x[kYawRate];
    const double torque = p_.mass * p_.wheel_radius * acceleration;
    const double share = acceleration > 0 ? p_.front_drive_share : p_.front_brake_share;
    dx[kFront] = spin(wheels.front.x(), share * torque);
    dx[kRear] = spin(wheels.rear.x(), (1 - share) * torque);
  }

  double spin(double force, double torque) const {
    return (torque - p_.wheel_radius * force) / p_.wheel_inertia;
  }

  void slow_derivative_of(const StateVector& x, double rate, double acceleration,
                          const Wheels& wheels, StateVector& dx) const {
    const SlowDerivative slow =
        slow_derivative(p_, {x[kSteering], x[kSpeed], x[kYaw], x[kSlip], rate, acceleration});
    dx.setZero();
    dx[kSpeed] = acceleration;
    dx[kYaw] = slow.yaw;
    dx[kYawRate] = slow.yaw_rate;
    dx[kSlip] = slow.slip_angle;
    const auto follow = [&](double hub_speed, double wheel) {
      return (hub_speed / p_.wheel_radius - std::max(0.0, wheel)) / kRollingTime;
    };
    dx[kFront] = follow(wheels.front_speed, x[kFront]);
    dx[kRear] = follow(wheels.rear_speed, x[kRear]);
  }

  SingleTrackParameters p_;
  PacejkaTyre tyre_;
};

}  // namespace

std::shared_ptr<const VehicleModel> make_single_track_drift(const SingleTrackParameters& parameters,
                                                            const PacejkaTyre& tyre) {
  return std::make_shared<SingleTrackDrift>(parameters, tyre);
}

}  // namespace blindcorner
