// SPDX-License-Identifier: Apache-2.0
/// Equations of motion of one kind of vehicle. A new kind needs one file that implements this
/// interface, and one line in the list of make_vehicle_model().
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "blindcorner/planner/vehicles/vehicle_state.h"

namespace blindcorner {

inline constexpr int kMaxStates = 12;
/// Values of a model's states, in the order of its state_names(). Never on the heap.
using StateVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxStates, 1>;

/// dx/dt = f(x, command). The model has no state of its own, so threads can share it.
class VehicleModel {
 public:
  virtual ~VehicleModel() = default;

  /// Short name, such as "car".
  virtual std::string name() const = 0;
  /// Names of the states with their units, such as "yaw_rad"; position x and y come first.
  virtual std::vector<std::string> state_names() const = 0;
  virtual VehicleRectangle footprint() const = 0;
  virtual VehicleLimits limits() const = 0;

  /// States of a vehicle with a given motion; its wheels roll without slip. Motion for which the
  /// model has no state is left out.
  virtual StateVector initial(const VehicleState& state) const = 0;
  virtual VehicleState motion(const StateVector& x) const = 0;
  /// Derivatives, in units of the states per second; `command` is clipped to the limits.
  virtual StateVector derivative(const StateVector& x, const VehicleCommand& command) const = 0;
  /// The command that fulfils the request by the end of a step of `dt` seconds.
  virtual VehicleCommand command(const StateVector& x, const DriveRequest& request,
                                 double dt) const = 0;
  /// Kinetic energy, J; NaN where the model has no masses.
  virtual double energy(const StateVector& x) const;
};

/// Models "car" and "robot" with their default parameters. Throws Error for other names.
std::shared_ptr<const VehicleModel> make_vehicle_model(const std::string& name);
std::vector<std::string> vehicle_model_names();

}  // namespace blindcorner
