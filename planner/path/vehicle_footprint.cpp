// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/vehicle_footprint.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// Discs reach beyond the sides by at most this share of the half width: 10 cm for a car with 6
/// discs, less than the error of its pose.
constexpr double kOverhang = 0.1;

void check_length(const char* what, double value, bool zero_is_fine) {
  if (std::isfinite(value) && (value > 0 || (zero_is_fine && value == 0))) return;
  throw Error(std::string("VehicleFootprint: ") + what + " = " + std::to_string(value) +
              "; accepted: a number of metres " + (zero_is_fine ? ">= 0" : "> 0"));
}

}  // namespace

VehicleFootprint VehicleFootprint::disc(double radius) {
  check_length("radius", radius, true);
  VehicleFootprint footprint;
  footprint.disc_radius_ = footprint.inscribed_radius_ = footprint.circumscribed_radius_ = radius;
  return footprint;
}

VehicleFootprint VehicleFootprint::rectangle(double length, double width, double center_ahead,
                                             double rear_axle) {
  check_length("length", length, false);
  check_length("width", width, false);
  if (!std::isfinite(center_ahead)) throw Error("VehicleFootprint: center_ahead is not a number");
  check_length("rear_axle", rear_axle, true);
  // A disc covers a slice of the rectangle: half its length h, half the width w, h^2 + w^2 = r^2.
  const double half_width = 0.5 * width;
  const double longest_half = half_width * std::sqrt((1 + kOverhang) * (1 + kOverhang) - 1);
  const int count = static_cast<int>(std::ceil(0.5 * length / longest_half));
  const double half_slice = 0.5 * length / count;
  VehicleFootprint footprint;
  footprint.rear_axle_ = rear_axle;
  footprint.disc_radius_ = std::hypot(half_slice, half_width);
  footprint.offsets_.clear();
  for (int i = 0; i < count; ++i) {
    footprint.offsets_.push_back(center_ahead - 0.5 * length + (2 * i + 1) * half_slice);
  }
  const double nearest_end = 0.5 * length - std::abs(center_ahead);
  footprint.inscribed_radius_ = std::max(0.0, std::min(half_width, nearest_end));
  footprint.circumscribed_radius_ =
      footprint.disc_radius_ +
      std::max(std::abs(footprint.offsets_.front()), std::abs(footprint.offsets_.back()));
  return footprint;
}

bool touch(const VehicleFootprint& a, const PlanarPose& at_a, const VehicleFootprint& b,
           const PlanarPose& at_b, double margin) {
  const double reach = a.circumscribed_radius() + b.circumscribed_radius() + margin;
  if ((at_a.position - at_b.position).squaredNorm() > reach * reach) return false;
  const double near = a.disc_radius() + b.disc_radius() + margin;
  const auto ahead = [](double heading) {
    return Eigen::Vector2d(std::cos(heading), std::sin(heading));
  };
  const Eigen::Vector2d along_a = ahead(at_a.heading), along_b = ahead(at_b.heading);
  for (const double i : a.disc_offsets()) {
    const Eigen::Vector2d center = at_a.position + i * along_a;
    for (const double j : b.disc_offsets()) {
      const Eigen::Vector2d other = at_b.position + j * along_b;
      if ((center - other).squaredNorm() < near * near) return true;
    }
  }
  return false;
}

}  // namespace blindcorner
