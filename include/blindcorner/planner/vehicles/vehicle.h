// SPDX-License-Identifier: Apache-2.0
/// A driving vehicle: equations of motion, their present states and an integrator.
#pragma once

#include <memory>

#include "blindcorner/planner/vehicles/integrator.h"
#include "blindcorner/planner/vehicles/vehicle_model.h"

namespace blindcorner {

/// Copies drive on independently, so a controller can simulate ahead.
class Vehicle {
 public:
  /// The vehicle stands at the origin and looks along +x.
  explicit Vehicle(std::shared_ptr<const VehicleModel> model,
                   std::shared_ptr<const Integrator> integrator = make_stiff_integrator());

  void place(const VehicleState& state) { x_ = model_->initial(state); }
  /// Advances by `dt` seconds with the command held. Throws Error unless dt is a number > 0 and the
  /// command is finite. Made for dt of 1 to 100 ms.
  void step(const VehicleCommand& command, double dt);
  /// The same for a controller's request.
  void step(const DriveRequest& request, double dt) { step(model_->command(x_, request, dt), dt); }

  VehicleState state() const { return model_->motion(x_); }
  /// All states of the model.
  const StateVector& states() const { return x_; }
  const VehicleModel& model() const { return *model_; }

 private:
  std::shared_ptr<const VehicleModel> model_;
  std::shared_ptr<const Integrator> integrator_;
  StateVector x_;
};

}  // namespace blindcorner
