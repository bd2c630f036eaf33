// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/vehicles/vehicle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "blindcorner/forward/error.h"
#include "blindcorner/planner/vehicles/car.h"
#include "blindcorner/planner/vehicles/differential_drive.h"

namespace blindcorner {
namespace {

using Models = std::vector<std::shared_ptr<const VehicleModel>>;

const Models& all_models() {
  static const Models models{make_car(), make_differential_drive()};
  return models;
}

}  // namespace

Transform T_world_vehicle(const VehicleState& state) {
  Transform transform = Transform::Identity();
  transform.translation() << state.position, 0;
  transform.linear() = Eigen::AngleAxisd(state.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return transform;
}

double yaw_on_path(double course, double curvature, double rear_axle) {
  return course - std::asin(std::clamp(curvature * rear_axle, -1.0, 1.0));
}

double VehicleModel::energy(const StateVector& /*x*/) const {
  return std::numeric_limits<double>::quiet_NaN();
}

std::shared_ptr<const VehicleModel> make_vehicle_model(const std::string& name) {
  std::string accepted;
  for (const auto& model : all_models()) {
    if (model->name() == name) return model;
    accepted += (accepted.empty() ? "" : ", ") + model->name();
  }
  throw Error("vehicle", "found '" + name + "', accepted: " + accepted);
}

std::vector<std::string> vehicle_model_names() {
  std::vector<std::string> names;
  for (const auto& model : all_models()) names.push_back(model->name());
  return names;
}

Vehicle::Vehicle(std::shared_ptr<const VehicleModel> model,
                 std::shared_ptr<const Integrator> integrator)
    : model_(std::move(model)), integrator_(std::move(integrator)), x_(model_->initial({})) {}

void Vehicle::step(const VehicleCommand& command, double dt) {
  if (!(dt > 0) || !std::isfinite(dt)) {
    throw Error("Vehicle::step: dt = " + std::to_string(dt) + "; accepted: seconds > 0");
  }
  if (!std::isfinite(command.acceleration) || !std::isfinite(command.steering)) {
    throw Error("Vehicle::step: the command is not finite; accepted: two numbers");
  }
  x_ = integrator_->advance([&](const StateVector& x) { return model_->derivative(x, command); },
                            x_, dt);
}

}  // namespace blindcorner
