// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/curve_limits.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {

double CurveLimits::speed(double start_speed, double arc_length) const {
  const double square = start_speed * start_speed - 2 * braking * arc_length;
  return std::max(std::sqrt(std::max(square, 0.0)), kCreeping * wanted_speed);
}

double CurveLimits::curvature(double speed) const {
  const double tightest =
      turning_radius > 0 ? 1 / turning_radius : std::numeric_limits<double>::infinity();
  return std::min(tightest, lateral_acceleration / std::max(speed * speed, 1e-9));
}

double CurveLimits::curvature_rate(double speed) const {
  return curvature_speed / std::max(speed, 1e-9);
}

double CurveLimits::slowness(double curvature, double rate) const {
  if (wanted_speed == 0) return 1;
  const double turning = std::sqrt(lateral_acceleration / std::max(std::abs(curvature), 1e-9));
  const double steering = curvature_speed / std::max(std::abs(rate), 1e-9);
  return std::max(1.0, wanted_speed / std::min(turning, steering));
}

void CurveLimits::validate() const {
  const auto require = [](const char* field, double value, bool good, const char* accepted) {
    if (good) return;
    throw Error(std::string("CurveLimits.") + field + " = " + std::to_string(value) +
                "; accepted: " + accepted);
  };
  require("turning_radius", turning_radius, turning_radius >= 0 && std::isfinite(turning_radius),
          "a number of metres >= 0");
  require("lateral_acceleration", lateral_acceleration, lateral_acceleration > 0, "m/s^2 > 0");
  require("curvature_speed", curvature_speed, curvature_speed > 0, "1/(m s) > 0");
  require("braking", braking, braking >= 0 && std::isfinite(braking), "m/s^2 >= 0");
  require("wanted_speed", wanted_speed, wanted_speed >= 0 && std::isfinite(wanted_speed),
          "m/s >= 0");
}

}  // namespace blindcorner
