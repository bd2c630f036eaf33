// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/car.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "planner/require_positive.h"
#include "planner/vehicles/single_track_limits.h"

namespace blindcorner {
namespace {

enum State { kX, kY, kYaw, kAlong, kAcross, kYawRate, kSteering, kFront, kRear, kStates };

/// Speed below which the course is taken as the car's long axis, m/s.
constexpr double kStanding = 1e-3;

/// Slip and force per load of an axle's tyres, in the wheel's frame.
struct Contact {
  Eigen::Vector2d slip, force;
};

class Car : public VehicleModel {
 public:
  explicit Car(const CarParameters& parameters) : c_(parameters), p_(parameters.body) {
    c_.validate();
  }

  std::string name() const override { return "car"; }
  std::vector<std::string> state_names() const override {
    return {"x_m",
            "y_m",
            "yaw_rad",
            "along_m_per_s",
            "across_m_per_s",
            "yaw_rate_rad_per_s",
            "steering_rad",
            "front_wheel_rad_per_s",
            "rear_wheel_rad_per_s"};
  }
  VehicleRectangle footprint() const override { return {p_.length, p_.width, 0, p_.rear_axle}; }
  VehicleLimits limits() const override {
    VehicleLimits limits = single_track_limits(p_, c_.friction * kGravity);
    limits.acceleration = std::min(limits.acceleration, traction());
    return limits;
  }

  StateVector initial(const VehicleState& state) const override {
    const double along = state.speed * std::cos(state.slip_angle);
    const double across = state.speed * std::sin(state.slip_angle);
    const double front_across = across + p_.front_axle * state.yaw_rate;
    const double front =
        along * std::cos(state.steering_angle) + front_across * std::sin(state.steering_angle);
    StateVector x(kStates);
    x << state.position, state.yaw, along, across, state.yaw_rate, state.steering_angle,
        front / p_.wheel_radius, along / p_.wheel_radius;
    return x;
  }

  VehicleState motion(const StateVector& x) const override {
    const double sign = x[kAlong] < 0 ? -1 : 1;
    const double speed = std::hypot(x[kAlong], x[kAcross]);
    return {.position = x.head<2>(),
            .yaw = x[kYaw],
            .speed = sign * speed,
            .steering_angle = x[kSteering],
            .yaw_rate = x[kYawRate],
            .slip_angle = speed < kStanding ? 0 : std::atan2(sign * x[kAcross], sign * x[kAlong])};
  }

  StateVector derivative(const StateVector& x, const VehicleCommand& command) const override {
    const Eigen::Rotation2Dd turn(x[kSteering]);
    const Eigen::Vector2d front_hub(x[kAlong], x[kAcross] + p_.front_axle * x[kYawRate]);
    const Eigen::Vector2d rear_hub(x[kAlong], x[kAcross] - p_.rear_axle * x[kYawRate]);
    const Contact front = contact(turn.inverse() * front_hub, x[kFront]);
    const Contact rear = contact(rear_hub, x[kRear]);
    const Eigen::Vector2d front_force = turn * front.force;  // per load, in the car's frame
    // Loads follow from the acceleration, and the acceleration from forces that are proportional to
    // the loads. This gives one linear equation for the acceleration along the car.
    const double height = p_.gravity_center_height, base = p_.wheelbase();
    const double along = kGravity *
                         (p_.rear_axle * front_force.x() + p_.front_axle * rear.force.x()) /
                         (base + height * (front_force.x() - rear.force.x()));
    const double front_load = (kGravity * p_.rear_axle - along * height) / base;  // N/kg
    const double rear_load = (kGravity * p_.front_axle + along * height) / base;
    const double front_across = front_load * front_force.y();
    const double rear_across = rear_load * rear.force.y();

    StateVector dx(kStates);
    dx.head<2>() = Eigen::Rotation2Dd(x[kYaw]) * x.segment<2>(kAlong);
    dx[kYaw] = x[kYawRate];
    dx[kAlong] = along + x[kAcross] * x[kYawRate];
    dx[kAcross] = front_across + rear_across - x[kAlong] * x[kYawRate];
    dx[kYawRate] =
        p_.mass / p_.yaw_inertia * (p_.front_axle * front_across - p_.rear_axle * rear_across);
    dx[kSteering] = possible_steering_rate(p_, x[kSteering], command.steering);
    const double wanted = possible_acceleration(p_, x[kAlong], command.acceleration);
    dx[kFront] = spin(front, x[kFront], front_load, wanted, p_.front_drive_share);
    dx[kRear] = spin(rear, x[kRear], rear_load, wanted, 1 - p_.front_drive_share);
    return dx;
  }

  VehicleCommand command(const StateVector& x, const DriveRequest& request,
                         double dt) const override {
    VehicleCommand command = single_track_command(p_, x[kAlong], x[kSteering], request, dt);
    command.acceleration = request.acceleration;  // brakes hold
    return command;
  }

  double energy(const StateVector& x) const override {
    return 0.5 * (p_.mass * x.segment<2>(kAlong).squaredNorm() +
                  p_.yaw_inertia * x[kYawRate] * x[kYawRate] +
                  p_.wheel_inertia * x.segment<2>(kFront).squaredNorm());
  }

 private:
  /// The hub's velocity is in the wheel's frame.
  Contact contact(const Eigen::Vector2d& hub, double wheel) const {
    const double rim = p_.wheel_radius * wheel;
    Contact contact;
    contact.slip = Eigen::Vector2d(rim - hub.x(), -hub.y()) / std::hypot(rim, c_.slip_speed);
    const double size = contact.slip.norm() / slip_limit();
    // (1 - (1 - size)^3) / size, which has no singularity.
    const double shape = size < 1 ? 3 - size * (3 - size) : 1 / size;
    contact.force = c_.friction / slip_limit() * shape * contact.slip;
    return contact;
  }

  /// Slip from which the whole tyre slides.
  double slip_limit() const { return 3 * c_.friction / c_.slip_stiffness; }

  /// Acceleration of a wheel, rad/s^2, with `load` in N per kg of the car.
  double spin(const Contact& contact, double wheel, double load, double wanted,
              double drive_share) const {
    const double radius = p_.wheel_radius;
    // Engine and brakes also accelerate the wheels of both axles.
    const double force = (p_.mass + 2 * p_.wheel_inertia / (radius * radius)) * wanted;
    double torque = 0;
    if (wanted > 0) {
      torque = radius * force * drive_share * eased(contact.slip.x());
    } else {
      torque = radius * force * load / kGravity * std::tanh(wheel / c_.brake_speed) *
               eased(std::abs(contact.slip.x()));
    }
    return (torque - radius * p_.mass * load * contact.force.x()) / p_.wheel_inertia;
  }

  /// Share of the torque that traction control and anti-lock let pass: all up to the slip at which
  /// the tyre slides, nothing from twice that on.
  double eased(double slip) const { return std::clamp(2 - slip / slip_limit(), 0.0, 1.0); }

  /// Acceleration that the driven rear wheels can hold: mu times their load under that
  /// acceleration, m/s^2.
  double traction() const {
    return kGravity * c_.friction * p_.front_axle /
           (p_.wheelbase() - c_.friction * p_.gravity_center_height);
  }

  CarParameters c_;
  SingleTrackParameters p_;
};

}  // namespace

void CarParameters::validate() const {
  body.validate();
  require_positive("CarParameters", "friction", friction);
  require_positive("CarParameters", "slip_stiffness", slip_stiffness);
  require_positive("CarParameters", "slip_speed", slip_speed);
  require_positive("CarParameters", "brake_speed", brake_speed);
}

std::shared_ptr<const VehicleModel> make_car(const CarParameters& parameters) {
  return std::make_shared<Car>(parameters);
}

}  // namespace blindcorner
