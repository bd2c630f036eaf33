// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/kinematic_single_track.h"

#include <cmath>

#include "planner/vehicles/single_track_limits.h"
#include "planner/vehicles/single_track_states.h"

namespace blindcorner {
namespace {

class KinematicSingleTrack : public VehicleModel {
 public:
  explicit KinematicSingleTrack(const SingleTrackParameters& parameters) : p_(parameters) {
    p_.validate();
  }

  std::string name() const override { return "kinematic_single_track"; }
  std::vector<std::string> state_names() const override {
    std::vector<std::string> names = single_track_state_names();
    names.resize(kKinematicStates);
    return names;
  }
  VehicleRectangle footprint() const override { return {p_.length, p_.width, p_.wheelbase() / 2}; }
  VehicleLimits limits() const override {
    VehicleLimits limits = single_track_limits(p_, kGravity);
    limits.curvature = std::tan(p_.steering_angle) / p_.wheelbase();
    return limits;
  }

  StateVector initial(const VehicleState& state) const override {
    return single_track_initial(state).head(kKinematicStates);
  }

  VehicleState motion(const StateVector& x) const override {
    VehicleState motion = single_track_motion(x);
    motion.yaw_rate = yaw_rate(x);
    return motion;
  }

  StateVector derivative(const StateVector& x, const VehicleCommand& command) const override {
    const double v = x[kSpeed];
    StateVector dx(kKinematicStates);
    dx[kX] = v * std::cos(x[kYaw]);
    dx[kY] = v * std::sin(x[kYaw]);
    dx[kSteering] = possible_steering_rate(p_, x[kSteering], command.steering);
    dx[kSpeed] = possible_acceleration(p_, v, command.acceleration);
    dx[kYaw] = yaw_rate(x);
    return dx;
  }

  VehicleCommand command(const StateVector& x, const DriveRequest& request,
                         double dt) const override {
    SingleTrackParameters of_rear_axle = p_;
    of_rear_axle.front_axle = p_.wheelbase(), of_rear_axle.rear_axle = 0;
    return single_track_command(of_rear_axle, x[kSpeed], x[kSteering], request, dt);
  }

 private:
  double yaw_rate(const StateVector& x) const {
    return x[kSpeed] * std::tan(x[kSteering]) / p_.wheelbase();
  }

  SingleTrackParameters p_;
};

}  // namespace

std::shared_ptr<const VehicleModel> make_kinematic_single_track(
    const SingleTrackParameters& parameters) {
  return std::make_shared<KinematicSingleTrack>(parameters);
}

}  // namespace blindcorner
