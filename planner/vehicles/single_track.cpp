// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/single_track.h"

#include <cmath>

#include "planner/require_positive.h"
#include "planner/vehicles/single_track_limits.h"
#include "planner/vehicles/single_track_states.h"
#include "planner/vehicles/slow_single_track.h"

namespace blindcorner {
namespace {

class SingleTrack : public VehicleModel {
 public:
  SingleTrack(const SingleTrackParameters& parameters, const SingleTrackTyres& tyres)
      : p_(parameters), tyres_(tyres) {
    p_.validate();
    require_positive("SingleTrackTyres", "friction", tyres.friction);
    require_positive("SingleTrackTyres", "front_stiffness", tyres.front_stiffness);
    require_positive("SingleTrackTyres", "rear_stiffness", tyres.rear_stiffness);
    require_positive("SingleTrackTyres", "kinematic_below", tyres.kinematic_below);
  }

  std::string name() const override { return "single_track"; }
  std::vector<std::string> state_names() const override { return single_track_state_names(); }
  VehicleRectangle footprint() const override { return {p_.length, p_.width, 0}; }
  VehicleLimits limits() const override {
    return single_track_limits(p_, tyres_.friction * kGravity);
  }

  StateVector initial(const VehicleState& state) const override {
    return single_track_initial(state);
  }

  VehicleState motion(const StateVector& x) const override { return single_track_motion(x); }

  StateVector derivative(const StateVector& x, const VehicleCommand& command) const override {
    const double rate = possible_steering_rate(p_, x[kSteering], command.steering);
    const double acceleration = possible_acceleration(p_, x[kSpeed], command.acceleration);
    StateVector dx(kSingleTrackStates);
    dx[kSteering] = rate;
    dx[kSpeed] = acceleration;
    if (std::abs(x[kSpeed]) < tyres_.kinematic_below) {
      const SlowDerivative slow =
          slow_derivative(p_, {x[kSteering], x[kSpeed], x[kYaw], x[kSlip], rate, acceleration});
      dx[kX] = slow.x, dx[kY] = slow.y, dx[kYaw] = slow.yaw;
      dx[kYawRate] = slow.yaw_rate, dx[kSlip] = slow.slip_angle;
    } else {
      with_tyres(x, acceleration, dx);
    }
    return dx;
  }

  VehicleCommand command(const StateVector& x, const DriveRequest& request,
                         double dt) const override {
    return single_track_command(p_, x[kSpeed], x[kSteering], request, dt);
  }

 private:
  void with_tyres(const StateVector& x, double acceleration, StateVector& dx) const {
    const double v = x[kSpeed];
    const double shift = acceleration * p_.gravity_center_height;
    const double front_load = (kGravity * p_.rear_axle - shift) / p_.wheelbase();  // N/kg
    const double rear_load = (kGravity * p_.front_axle + shift) / p_.wheelbase();
    const double front_slip = x[kSteering] - x[kSlip] - p_.front_axle * x[kYawRate] / v;
    const double rear_slip = -x[kSlip] + p_.rear_axle * x[kYawRate] / v;
    const double front = tyres_.friction * tyres_.front_stiffness * front_load * front_slip;
    const double rear = tyres_.friction * tyres_.rear_stiffness * rear_load * rear_slip;
    dx[kX] = v * std::cos(x[kYaw] + x[kSlip]);
    dx[kY] = v * std::sin(x[kYaw] + x[kSlip]);
    dx[kYaw] = x[kYawRate];
    dx[kYawRate] = p_.mass / p_.yaw_inertia * (p_.front_axle * front - p_.rear_axle * rear);
    dx[kSlip] = (front + rear) / v - x[kYawRate];
  }

  SingleTrackParameters p_;
  SingleTrackTyres tyres_;
};

}  // namespace

std::shared_ptr<const VehicleModel> make_single_track(const SingleTrackParameters& parameters,
                                                      const SingleTrackTyres& tyres) {
  return std::make_shared<SingleTrack>(parameters, tyres);
}

}  // namespace blindcorner
