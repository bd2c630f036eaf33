// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/safe_speed.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <string>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "blindcorner/planner/control/speed_profile.h"

namespace blindcorner {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Length over which a path's curvature is averaged, m: changes within a wheelbase do not matter to
/// a car.
constexpr double kAveraged = 2.0;
/// Lengths over which changes of curvature are examined, m: from a car's length to half a street's
/// turn.
constexpr std::array kSteeringLengths{4.0, 7.0, 12.0};
/// Share of the steering's rate that a plan uses; the rest is left for control.
constexpr double kSteeringShare = 0.8;

/// A stop at a place of the path: the largest speeds from which it is possible.
class Stop {
 public:
  Stop(std::span<const PathPoint> path, double place, const VehicleLimits& limits, double braking)
      : braking_(braking * limits.friction) {
    const auto after = std::ranges::lower_bound(path, place, {}, &PathPoint::arc_length);
    points_.assign(path.begin(), after);
    points_.push_back(path_at(path, place));
    points_.back().arc_length = place;
    SpeedProfileOptions options;
    options.speed = options.start = limits.speed;
    options.cornering = 1;  // the vehicle's own profile limits the speed in curves
    options.braking = braking;
    speeds_ = speed_profile(points_, limits, options);
  }

  /// Largest speed at an arc length from which the vehicle stops in time, m/s.
  double speed_at(double arc_length) const {
    if (arc_length >= points_.back().arc_length) return 0;
    const auto after = std::ranges::upper_bound(points_, arc_length, {}, &PathPoint::arc_length);
    if (after == points_.begin()) return speeds_.front();
    const auto i = static_cast<std::size_t>(after - points_.begin());
    const double from = points_[i - 1].arc_length;
    const double share = (arc_length - from) / (points_[i].arc_length - from);
    const double low = speeds_[i - 1] * speeds_[i - 1], high = speeds_[i] * speeds_[i];
    return std::sqrt(low + share * (high - low));
  }

  /// The same for a vehicle that brakes only after a reaction time, s, for an object that comes
  /// towards it at `closing_speed`, m/s.
  double speed_at(double arc_length, double reaction_time, double closing_speed) const {
    double low = 0, high = speed_at(arc_length);
    constexpr int kHalvings = 30;  // to 1e-8 m/s
    for (int i = 0; i < kHalvings && low < high; ++i) {
      const double v = (low + high) / 2;
      const double taken = v * reaction_time + closing_speed * (reaction_time + v / braking_);
      (v <= speed_at(arc_length + taken) ? low : high) = v;
    }
    return low;
  }

 private:
  double braking_;  ///< m/s^2
  std::vector<PathPoint> points_;
  std::vector<double> speeds_;  ///< m/s, at the points
};

/// A speed that is asked for at a place of the path.
struct Demand {
  double speed = 0;        ///< m/s
  double place = 0;        ///< m
  double probability = 0;  ///< of the objects that ask for it
};

/// Demands of encounters that are still ahead. Those that share contact and sight are one.
std::vector<Demand> demands_of(std::span<const PathPoint> path, const VehicleLimits& limits,
                               std::span<const Encounter> encounters, double from,
                               const SafeSpeedOptions& options) {
  std::map<std::pair<double, double>, double> ahead;
  for (const Encounter& encounter : encounters) {
    const double contact = encounter.contact - options.margin;
    if (!(encounter.probability > 0) || encounter.contact < from ||
        contact > path.back().arc_length) {
      continue;
    }
    const double stop = std::max(from, contact);
    ahead[{stop, std::clamp(encounter.sight, from, stop)}] += encounter.probability;
  }
  std::vector<Demand> demands;
  std::map<double, Stop> stops;
  for (const auto& [places, probability] : ahead) {
    const auto& [place, sight] = places;
    const Stop& stop = stops.try_emplace(place, path, place, limits, options.braking).first->second;
    const double closing =
        sight > from ? options.closing_speed : 0.0;  // an object in sight shows its own speed
    demands.push_back({stop.speed_at(sight, options.reaction_time, closing), sight, probability});
  }
  return demands;
}

void require(const char* field, double value, bool good, const char* accepted) {
  if (good) return;
  throw Error("SafeSpeedOptions." + std::string(field) + " = " + std::to_string(value) +
              "; accepted: " + accepted);
}

void check(const Encounter& encounter) {
  const double p = encounter.probability;
  if (p >= 0 && p <= 1 && std::isfinite(encounter.contact) && !std::isnan(encounter.sight)) return;
  throw Error("encounter", "probability " + std::to_string(p) + ", contact " +
                               std::to_string(encounter.contact) + ", sight " +
                               std::to_string(encounter.sight) +
                               "; accepted: a probability and two arc lengths");
}

}  // namespace

void SafeSpeedOptions::validate() const {
  require("risk", risk, risk >= 0 && risk <= 1, "a probability");
  require("reaction_time", reaction_time, reaction_time >= 0 && std::isfinite(reaction_time),
          "seconds >= 0");
  require("braking", braking, braking > 0 && braking <= 1, "a share above 0, at most 1");
  require("closing_speed", closing_speed, closing_speed >= 0 && std::isfinite(closing_speed),
          "m/s >= 0");
  require("margin", margin, margin >= 0 && std::isfinite(margin), "metres >= 0");
}

std::vector<double> safe_speed_limits(std::span<const PathPoint> path, const VehicleLimits& limits,
                                      std::span<const Encounter> encounters, double from,
                                      const SafeSpeedOptions& options) {
  options.validate();
  if (!std::isfinite(from)) throw Error("safe speed", "the vehicle's arc length is not finite");
  std::ranges::for_each(encounters, check);
  std::vector<double> speeds(path.size(), kInfinity);
  if (path.empty()) return speeds;
  std::vector<Demand> demands = demands_of(path, limits, encounters, from, options);
  std::ranges::stable_sort(demands, {}, &Demand::speed);
  double disregarded = 0;
  auto demand = demands.begin();
  while (demand != demands.end() && disregarded + demand->probability <= options.risk) {
    disregarded += (demand++)->probability;
  }
  for (; demand != demands.end(); ++demand) {
    // Both samples around the place are limited, because v^2 is linear between them.
    const auto after = std::ranges::upper_bound(path, demand->place, {}, &PathPoint::arc_length);
    const auto i = static_cast<std::size_t>(after - path.begin());
    if (i > 0) speeds[i - 1] = std::min(speeds[i - 1], demand->speed);
    if (i < path.size()) speeds[i] = std::min(speeds[i], demand->speed);
  }
  return speeds;
}

std::vector<double> steerable_speeds(std::span<const PathPoint> path, const VehicleLimits& limits,
                                     double from, double curvature) {
  std::vector<double> speeds(path.size(), kInfinity);
  if (path.empty() || limits.wheelbase == 0 || !std::isfinite(limits.steering_rate)) return speeds;
  const double end = path.back().arc_length;
  const auto mean_curvature = [&](double middle) {
    const double b = std::clamp(middle + kAveraged / 2, from, end), a = b - kAveraged;
    if (a < from) return middle > from ? path_at(path, middle).curvature : curvature;
    return std::remainder(path_at(path, b).heading - path_at(path, a).heading, 2 * kPi) / (b - a);
  };
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (path[i].arc_length < from) continue;
    for (const double length : kSteeringLengths) {
      const double before = mean_curvature(path[i].arc_length - length / 2);
      const double after = mean_curvature(path[i].arc_length + length / 2);
      const double turn =
          std::abs(std::atan(limits.wheelbase * after) - std::atan(limits.wheelbase * before));
      const double rate = kSteeringShare * limits.steering_rate;
      speeds[i] = std::min(speeds[i], rate * length / std::max(turn, 1e-6));
    }
  }
  return speeds;
}

void stop_at(std::span<const PathPoint> path, double arc_length, std::span<double> speeds) {
  if (speeds.size() != path.size() || std::isnan(arc_length)) {
    throw Error("stop_at: " + std::to_string(speeds.size()) + " speeds, arc length " +
                std::to_string(arc_length) + "; accepted: " + std::to_string(path.size()) +
                " speeds, one for each sample, and a number");
  }
  const auto after = std::ranges::upper_bound(path, arc_length, {}, &PathPoint::arc_length);
  const auto first = std::max<std::ptrdiff_t>(1, after - path.begin()) - 1;
  std::ranges::fill(speeds.subspan(static_cast<std::size_t>(first)), 0.0);
}

}  // namespace blindcorner
