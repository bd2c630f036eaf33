// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/speed_profile.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

/// Squared speeds, m^2/s^2, of a path's samples.
class Profile {
 public:
  Profile(std::span<const PathPoint> path, const VehicleLimits& limits,
          const SpeedProfileOptions& options)
      : path_(path), cornering_(options.cornering * limits.friction), square_(path.size()) {
    for (std::size_t i = 0; i < path.size(); ++i) curvature_.push_back(drivable_curvature(i));
    const double most = std::min(options.speed, limits.speed);
    for (std::size_t i = 0; i < path.size(); ++i) {
      const double curve = cornering_ / std::max(curvature_[i], 1e-9);
      square_[i] = std::min(most * most, curve);
    }
  }

  /// Lowers the speed at sample `to` to what is reachable from its neighbour `from` with
  /// `strongest` m/s^2 on a straight line.
  void reach(std::size_t from, std::size_t to, double strongest) {
    const double distance = std::abs(path_[to].arc_length - path_[from].arc_length);
    const auto reached = [&](double left) {
      return std::min(square_[to], square_[from] + 2 * distance * strongest * left);
    };
    // The friction circle leaves less at the faster of the two.
    const double left = beside_cornering(from, square_[from]);
    square_[to] = reached(std::min(left, beside_cornering(to, reached(left))));
  }

  void limit(std::size_t sample, double speed) {
    square_[sample] = std::min(square_[sample], speed * speed);
  }

  std::vector<double> speeds() const {
    std::vector<double> speeds;
    for (const double square : square_) speeds.push_back(std::sqrt(square));
    return speeds;
  }

 private:
  /// Share of the longitudinal acceleration that cornering leaves: an ellipse.
  double beside_cornering(std::size_t sample, double square) const {
    const double used = square * curvature_[sample] / cornering_;
    return std::sqrt(std::max(0.0, 1 - used * used));
  }

  /// 1/m, without its sign. A cusp counts as a turn back between the neighbouring points: no
  /// vehicle would drive on from a speed of 0 there.
  double drivable_curvature(std::size_t i) const {
    const std::size_t before = i == 0 ? 0 : i - 1, after = std::min(i + 1, path_.size() - 1);
    const double room = path_[after].arc_length - path_[before].arc_length;
    const double tightest = 2 * kPi / std::max(room, 1e-9);
    return std::isfinite(path_[i].curvature) ? std::abs(path_[i].curvature) : tightest;
  }

  std::span<const PathPoint> path_;
  double cornering_;  ///< m/s^2
  std::vector<double> curvature_;
  std::vector<double> square_;
};

}  // namespace

void SpeedProfileOptions::validate() const {
  const auto require = [](const char* field, double value, bool good, const char* accepted) {
    if (good) return;
    throw Error("SpeedProfileOptions." + std::string(field) + " = " + std::to_string(value) +
                "; accepted: " + accepted);
  };
  require("speed", speed, speed >= 0, "m/s >= 0");
  require("start", start, start >= 0, "m/s >= 0");
  require("end", end, end >= 0, "m/s >= 0");
  require("cornering", cornering, cornering > 0, "a share > 0");
  require("braking", braking, braking > 0 && braking <= 1, "a share above 0, at most 1");
  require("driving", driving, driving > 0 && driving <= 1, "a share above 0, at most 1");
  for (const double limit : limits) require("limits", limit, limit >= 0, "m/s >= 0");
}

std::vector<double> speed_profile(std::span<const PathPoint> path, const VehicleLimits& limits,
                                  const SpeedProfileOptions& options) {
  options.validate();
  Profile profile(path, limits, options);
  if (path.empty()) return {};
  if (!options.limits.empty() && options.limits.size() != path.size()) {
    throw Error("SpeedProfileOptions.limits: " + std::to_string(options.limits.size()) +
                " values; accepted: none or " + std::to_string(path.size()) + ", one per sample");
  }
  for (std::size_t i = 0; i < options.limits.size(); ++i) profile.limit(i, options.limits[i]);
  profile.limit(path.size() - 1, options.end);
  for (std::size_t i = path.size() - 1; i > 0; --i) {
    profile.reach(i, i - 1, options.braking * limits.friction);
  }
  profile.limit(0, options.start);
  const double driving = std::min(limits.acceleration, options.driving * limits.friction);
  for (std::size_t i = 0; i + 1 < path.size(); ++i) profile.reach(i, i + 1, driving);
  return profile.speeds();
}

}  // namespace blindcorner
