// SPDX-License-Identifier: Apache-2.0
/// A vehicle: a cart that turns about the middle of its axle. docs/adding.md shows it;
/// adding_test.cpp drives it in a circle.
#include <algorithm>
#include <cmath>

#include "adding/examples.h"

namespace blindcorner {
namespace {

// [vehicle]
/// States: x, y (m), yaw (rad), speed (m/s), yaw rate (rad/s). A command's steering is the change
/// of the yaw rate, rad/s^2.
class Cart final : public VehicleModel {
 public:
  std::string name() const override { return "cart"; }
  std::vector<std::string> state_names() const override {
    return {"x_m", "y_m", "yaw_rad", "speed_m_per_s", "yaw_rate_rad_per_s"};
  }
  VehicleRectangle footprint() const override { return {.length = 0.8, .width = 0.5}; }
  VehicleLimits limits() const override {
    return {.speed = 2, .acceleration = kAcceleration, .friction = kAcceleration};
  }

  StateVector initial(const VehicleState& state) const override {
    StateVector x(5);
    x << state.position, state.yaw, state.speed, state.yaw_rate;
    return x;
  }
  VehicleState motion(const StateVector& x) const override {
    return {.position = x.head<2>(), .yaw = x[2], .speed = x[3], .yaw_rate = x[4]};
  }
  StateVector derivative(const StateVector& x, const VehicleCommand& command) const override {
    StateVector dx(5);
    dx << x[3] * std::cos(x[2]), x[3] * std::sin(x[2]), x[4],
        std::clamp(command.acceleration, -kAcceleration, kAcceleration),
        std::clamp(command.steering, -kTurning, kTurning);
    return dx;
  }
  VehicleCommand command(const StateVector& x, const DriveRequest& request,
                         double dt) const override {
    return {.acceleration = request.acceleration,
            .steering = (request.curvature * x[3] - x[4]) / dt};
  }

 private:
  static constexpr double kAcceleration = 1;  ///< m/s^2
  static constexpr double kTurning = 5;       ///< rad/s^2
};

std::shared_ptr<const VehicleModel> make_cart() { return std::make_shared<Cart>(); }
// [/vehicle]

}  // namespace

std::shared_ptr<const VehicleModel> cart() { return make_cart(); }

}  // namespace blindcorner
