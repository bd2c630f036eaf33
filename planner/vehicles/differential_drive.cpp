// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/differential_drive.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/planner/vehicles/single_track_parameters.h"
#include "planner/require_positive.h"
#include "planner/vehicles/single_track_limits.h"

namespace blindcorner {
namespace {

enum State { kX, kY, kYaw, kLeft, kRight, kStates };

/// Least speed at which a requested curvature becomes a yaw rate, m/s.
constexpr double kTurningSpeed = 0.2;

class DifferentialDrive : public VehicleModel {
 public:
  explicit DifferentialDrive(const DifferentialDriveParameters& parameters) : p_(parameters) {
    p_.validate();
  }

  std::string name() const override { return "robot"; }
  std::vector<std::string> state_names() const override {
    return {"x_m", "y_m", "yaw_rad", "left_m_per_s", "right_m_per_s"};
  }
  VehicleRectangle footprint() const override { return {p_.length, p_.width, p_.axle_to_center}; }
  VehicleLimits limits() const override {
    return {.speed = p_.wheel_speed,
            .acceleration = p_.acceleration,
            .friction = std::min(p_.acceleration, p_.friction * kGravity)};
  }

  StateVector initial(const VehicleState& state) const override {
    const double turn = 0.5 * p_.track * state.yaw_rate;
    StateVector x(kStates);
    x << state.position, state.yaw, state.speed - turn, state.speed + turn;
    return x;
  }

  VehicleState motion(const StateVector& x) const override {
    return {.position = x.head<2>(),
            .yaw = x[kYaw],
            .speed = 0.5 * (x[kLeft] + x[kRight]),
            .yaw_rate = (x[kRight] - x[kLeft]) / p_.track};
  }

  StateVector derivative(const StateVector& x, const VehicleCommand& command) const override {
    const VehicleState now = motion(x);
    const double turn = 0.5 * p_.track * command.steering;
    StateVector dx(kStates);
    dx[kX] = now.speed * std::cos(now.yaw);
    dx[kY] = now.speed * std::sin(now.yaw);
    dx[kYaw] = now.yaw_rate;
    dx[kLeft] = possible(x[kLeft], command.acceleration - turn);
    dx[kRight] = possible(x[kRight], command.acceleration + turn);
    return dx;
  }

  VehicleCommand command(const StateVector& x, const DriveRequest& request,
                         double dt) const override {
    const VehicleState now = motion(x);
    // Clipping one wheel alone would trade braking for turning. If both together are too much,
    // turning gets what braking leaves, at least half of the wheels' acceleration.
    const double limit = p_.acceleration;
    const double asked =
        std::clamp(without_reversing(request.acceleration, now.speed, dt), -limit, limit);
    const double turn_limit = std::max(limit - std::abs(asked), limit / 2);
    const double fastest = 2 * p_.wheel_speed / p_.track;
    double forward = asked, turn = 0;
    // The yaw rate is that of the curvature at the speed that is reached. It is a fixed point, and
    // each pass multiplies the error by half a track over the curve's radius (0.1 at 1 m).
    for (int pass = 0; pass < 4; ++pass) {
      const double speed = std::max(std::abs(now.speed + forward * dt), kTurningSpeed);
      const double wanted = std::clamp(request.curvature * speed, -fastest, fastest);
      turn = std::clamp(0.5 * p_.track * (wanted - now.yaw_rate) / dt, -turn_limit, turn_limit);
      const double left = limit - std::abs(turn);
      forward = std::clamp(asked, -left, left);
    }
    return {.acceleration = forward, .steering = turn / (0.5 * p_.track)};
  }

 private:
  double possible(double wheel, double acceleration) const {
    const bool at_limit = std::abs(wheel) >= p_.wheel_speed && wheel * acceleration > 0;
    return at_limit ? 0 : std::clamp(acceleration, -p_.acceleration, p_.acceleration);
  }

  DifferentialDriveParameters p_;
};

}  // namespace

void DifferentialDriveParameters::validate() const {
  const auto positive = [](const char* field, double value) {
    require_positive("DifferentialDriveParameters", field, value);
  };
  positive("length", length);
  positive("width", width);
  positive("track", track);
  positive("wheel_speed", wheel_speed);
  positive("acceleration", acceleration);
  positive("friction", friction);
}

std::shared_ptr<const VehicleModel> make_differential_drive(
    const DifferentialDriveParameters& parameters) {
  return std::make_shared<DifferentialDrive>(parameters);
}

}  // namespace blindcorner
