// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/drive_limits.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "blindcorner/forward/error.h"
#include "blindcorner/forward/sensor/link_budget.h"
#include "blindcorner/planner/control/path_follower.h"
#include "blindcorner/planner/grid/line_of_sight.h"
#include "blindcorner/simulation/drive_loop.h"
#include "blindcorner/simulation/perception.h"
#include "blindcorner/simulation/true_world.h"
#include "simulation/convex_distance.h"
#include "simulation/drive_setup.h"

namespace blindcorner {
namespace {

/// s for which vehicle and object are followed after braking has begun. By then an object that
/// crosses has passed.
constexpr double kFollowed = 15;
/// s between the times at which sight is tested first: a frame of 10 Hz.
constexpr double kSightStep = 0.1;
/// Times are found to within these, s.
constexpr double kResolved = 0.01, kLightResolved = 0.07;

/// The drive with its intervals at their middle, with the fastest object, and nothing left to
/// chance.
Drive hardest(const Drive& drive) {
  Drive middle = drive;
  DriveTruth& truth = middle.truth;
  truth.present = 1;
  for (std::size_t i = 0; i < truth.components.size(); ++i) {
    const Unknown& unknown = drive.scene.unknowns[i];
    const TrueComponent range =
        truth.components[i].value_or(TrueComponent{unknown.lower, unknown.upper});
    const double value = (range.lower + range.upper) / 2;
    truth.components[i] = TrueComponent{value, value};
  }
  for (std::size_t i = 0; i < truth.velocity_upper.size(); ++i) {
    for (const Eigen::Index axis : {0, 1}) {
      const double upper = truth.velocity_upper[i][axis];
      if (std::abs(upper) > std::abs(truth.velocity[i][axis])) truth.velocity[i][axis] = upper;
    }
  }
  truth.velocity_upper.clear();
  truth.turn.reset();
  if (truth.meeting) truth.meeting->spread = 0;
  middle.vehicle.localization_sigma = middle.vehicle.localization_yaw_sigma = 0;
  middle.sensor.missing_share = middle.sensor.late_share = 0;
  return middle;
}

/// A forward model that returns light computed before, for link_budget().
class KnownLight final : public ForwardModel {
 public:
  explicit KnownLight(SensedLight light) : light_(std::move(light)) {}
  void three_bounce(const PoseVector& /*pose*/, HistogramCube& out) const override {
    out = light_.three_bounce;
  }
  const HistogramCube& static_background() const override { return light_.static_background; }
  const TransportPlan& plan() const override { return plan_; }

 private:
  SensedLight light_;
  TransportPlan plan_;
};

/// The vehicle on its way as if nobody were there, and the object beside it.
class Approach {
 public:
  Approach(const Drive& drive, const SimulatedSensor& sensor, double speed);

  /// s, when they first touch if nobody acts; empty: never.
  std::optional<double> contact() const { return first_contact(kNever); }
  /// The last time at which braking avoids all contact; empty: none does.
  std::optional<double> last_braking(double contact) const;
  std::optional<double> first_sight(const LineOfSight& sight, double until) const;
  std::optional<double> first_light(const DriveLimitsOptions& options, double until) const;

 private:
  static constexpr double kNever = 1e9;

  VehicleState at(double arc_length) const;
  double arc_length(double time, double braking_from) const;
  VehicleState state(double time) const { return at(arc_length(time, kNever)); }
  std::optional<double> first_contact(double braking_from) const;
  Transform sensor_pose(double time) const {
    return T_world_vehicle(state(time)) * drive_.sensor.T_vehicle_sensor;
  }
  double signal_to_noise(double time) const;

  const Drive& drive_;
  const SimulatedSensor& sensor_;
  TrueWorld world_;
  VehicleRectangle body_;
  double friction_;  ///< m/s^2
  std::vector<Eigen::Vector3d> trace_;
  std::vector<double> driven_;  ///< m, at the trace's points
  double step_ = 0;             ///< s between them
};

Approach::Approach(const Drive& drive, const SimulatedSensor& sensor, double speed)
    : drive_(drive), sensor_(sensor), world_(drive, 1, speed) {
  const auto model = model_of(drive.vehicle);
  body_ = model->footprint();
  friction_ = model->limits().friction;
  Drive empty = drive;
  empty.truth.present = 0;
  DriveOptions options;
  options.perception = "oracle";
  options.speed = speed;
  options.keep_pictures = false;
  const DriveResult driven = drive_through(empty, sensor, options);
  step_ = driven.trace_step;
  const Eigen::Vector2d start = world_.vehicle_start();
  trace_.emplace_back(start.x(), start.y(), drive.vehicle.start_yaw);
  trace_.insert(trace_.end(), driven.trace.begin(), driven.trace.end());
  driven_.push_back(0);
  for (std::size_t i = 1; i < trace_.size(); ++i) {
    driven_.push_back(driven_.back() + (trace_[i] - trace_[i - 1]).head<2>().norm());
  }
}

/// m driven at a time, s. From `braking_from` on, the vehicle brakes at the friction limit.
double Approach::arc_length(double time, double braking_from) const {
  const double place = std::clamp(std::min(time, braking_from) / step_, 0.0,
                                  static_cast<double>(driven_.size() - 1));
  const auto i = std::min(static_cast<std::size_t>(place), driven_.size() - 2);
  const double speed = (driven_[i + 1] - driven_[i]) / step_;
  const double before = driven_[i] + (place - static_cast<double>(i)) * speed * step_;
  if (time <= braking_from) return before;
  const double braked = std::min(time - braking_from, speed / friction_);
  return before + speed * braked - 0.5 * friction_ * braked * braked;
}

VehicleState Approach::at(double arc_length) const {
  const auto after = std::ranges::upper_bound(driven_, arc_length);
  const auto i = static_cast<std::size_t>(
      std::clamp<std::ptrdiff_t>(after - driven_.begin(), 1, std::ssize(driven_) - 1));
  const double piece = driven_[i] - driven_[i - 1];
  const double share =
      piece > 0 ? std::clamp((arc_length - driven_[i - 1]) / piece, 0.0, 1.0) : 0.0;
  const Eigen::Vector3d place = trace_[i - 1] + share * (trace_[i] - trace_[i - 1]);
  VehicleState state;
  state.position = place.head<2>();
  state.yaw = place.z();
  return state;
}

std::optional<double> Approach::first_contact(double braking_from) const {
  const double way = step_ * static_cast<double>(trace_.size() - 1);
  const double end = braking_from < kNever ? braking_from + kFollowed : way;
  for (double time = 0; time <= end; time += step_) {
    const Transform T = T_world_vehicle(at(arc_length(time, braking_from)));
    Polygon outline;
    for (const auto& [x, y] : {std::pair(-0.5, -0.5), {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) {
      const Eigen::Vector3d corner(body_.center_x + x * body_.length, y * body_.width, 0);
      outline.push_back((T * corner).head<2>());
    }
    for (const Polygon& body : world_.bodies(time)) {
      if (convex_distance(outline, body) <= 0) return time;
    }
  }
  return std::nullopt;
}

std::optional<double> Approach::last_braking(double contact) const {
  double low = 0, high = contact;
  if (first_contact(low)) return std::nullopt;
  while (high - low > kResolved) {
    const double middle = (low + high) / 2;
    (first_contact(middle) ? high : low) = middle;
  }
  return low;
}

/// The first time at which something holds: searched in steps, then by bisection between the last
/// two.
template <typename Holds>
std::optional<double> first_time(double step, double resolved, double until, const Holds& holds) {
  double low = 0;
  for (double high = 0; high <= until; high += step) {
    if (!holds(high)) {
      low = high;
      continue;
    }
    while (high - low > resolved) {
      const double middle = (low + high) / 2;
      (holds(middle) ? high : low) = middle;
    }
    return high;
  }
  return std::nullopt;
}

std::optional<double> Approach::first_sight(const LineOfSight& sight, double until) const {
  return first_time(kSightStep, kResolved, until, [&](double time) {
    const auto scan = sight.scan(sensor_pose(time), world_.placements(time));
    return !scan.objects_seen.empty() && scan.objects_seen.front();
  });
}

/// Signal-to-noise ratio of the best zone.
double Approach::signal_to_noise(double time) const {
  const PoseVector pose = *world_.hidden(time);
  const KnownLight light(sensor_.light(sensor_pose(time), pose));
  double best = 0;
  for (const ZoneBudget& zone : link_budget(sensor_.scene(), light, pose)) {
    best = std::max(best, zone.signal_to_noise);
  }
  return best;
}

std::optional<double> Approach::first_light(const DriveLimitsOptions& options, double until) const {
  return first_time(options.light_step, kLightResolved, until,
                    [&](double time) { return signal_to_noise(time) > options.signal_to_noise; });
}

/// Interpolates the values that were not computed, between neighbours `every` apart that both have
/// one.
void interpolate(std::vector<std::optional<double>>& values, int every) {
  const auto step = static_cast<std::size_t>(every);
  for (std::size_t i = 0; i + step < values.size(); i += step) {
    const auto &low = values[i], &high = values[i + step];
    if (!low || !high) continue;
    for (std::size_t k = 1; k < step; ++k) {
      values[i + k] = *low + (*high - *low) * static_cast<double>(k) / every;
    }
  }
}

/// Lowest speed above which there is less time than needed, interpolated between the samples before
/// and after. It is the first sample's speed if that has too little time already.
std::optional<double> limit_of(const std::vector<double>& speed,
                               const std::vector<std::optional<double>>& there,
                               const std::vector<std::optional<double>>& needed) {
  std::optional<double> before;
  for (std::size_t i = 0; i < speed.size(); ++i) {
    if (!needed[i]) continue;
    const double spare = there[i].value_or(0) - *needed[i];
    if (spare < 0 && !before) return speed[i];
    if (spare < 0) return speed[i] + (speed[i - 1] - speed[i]) * spare / (spare - *before);
    before = spare;
  }
  return std::nullopt;
}

using Json = nlohmann::ordered_json;

Json or_null(const std::optional<double>& value) {
  return value ? Json(std::round(1e3 * *value) / 1e3) : Json(nullptr);
}

Json list_of(const std::vector<std::optional<double>>& values) {
  Json list = Json::array();
  for (const auto& value : values) list.push_back(or_null(value));
  return list;
}

}  // namespace

void DriveLimitsOptions::validate() const {
  if (speeds < 1) throw Error("DriveLimitsOptions.speeds", "accepted: a number > 0");
  if (!(signal_to_noise > 0)) {
    throw Error("DriveLimitsOptions.signal_to_noise", "accepted: a number > 0");
  }
  if (light_every < 0) throw Error("DriveLimitsOptions.light_every", "accepted: a number >= 0");
  if (!(light_step > 0)) throw Error("DriveLimitsOptions.light_step", "accepted: seconds > 0");
}

bool states_who_is_met(const Drive& drive) {
  if (drive.truth.meeting) return true;
  int stated = 0;
  for (std::size_t i = 0; i < drive.truth.components.size(); ++i) {
    const Unknown& unknown = drive.scene.unknowns[i];
    const bool place = unknown.component == Component::x || unknown.component == Component::y;
    if (unknown.object == 0 && place && drive.truth.components[i]) ++stated;
  }
  return stated == 2;
}

DriveLimits drive_limits(const Drive& drive, const SimulatedSensor& sensor,
                         const DriveLimitsOptions& options) {
  options.validate();
  const Drive middle = hardest(drive);
  const LineOfSight sight(middle.scene, middle.map, sight_options(middle));
  const double sees_after = declared_delay(drive, "los");
  const double reaction = 1 / drive.sensor.rate + sees_after + PathFollowerOptions{}.delay;
  const double later = std::max(0.0, declared_delay(drive, "solver") - sees_after);
  DriveLimits limits;
  const double lower = drive.trials.speed_lower, upper = drive.trials.speed_upper;
  const int count = lower < upper ? options.speeds : 1;
  for (int i = 0; i < count; ++i) {
    limits.speed.push_back(count > 1 ? lower + (upper - lower) * i / (count - 1) : lower);
    const Approach approach(middle, sensor, limits.speed.back());
    const std::optional<double> contact = approach.contact();
    const auto before = [&](const std::optional<double>& time, double added) {
      return time ? std::optional(*contact - *time + added) : std::nullopt;
    };
    std::optional<double> seen, braked, lit;
    if (contact) {
      seen = before(approach.first_sight(sight, *contact), 0);
      braked = before(approach.last_braking(*contact), reaction);
      if (options.light_every > 0 && i % options.light_every == 0)
        lit = before(approach.first_light(options, *contact), -later);
    }
    limits.sight.push_back(seen);
    limits.stop.push_back(braked);
    limits.light.push_back(lit);
  }
  limits.sight_limit = limit_of(limits.speed, limits.sight, limits.stop);
  if (options.light_every > 0) interpolate(limits.light, options.light_every);
  if (options.light_every > 0)
    limits.light_limit = limit_of(limits.speed, limits.light, limits.stop);
  return limits;
}

std::string limits_json(const DriveLimits& limits) {
  Json json;
  json["speed_m_per_s"] = Json::array();
  for (const double speed : limits.speed) json["speed_m_per_s"].push_back(or_null(speed));
  json["direct_sight_s"] = list_of(limits.sight);
  json["stop_s"] = list_of(limits.stop);
  json["light_s"] = list_of(limits.light);
  json["direct_sight_limit_m_per_s"] = or_null(limits.sight_limit);
  json["light_limit_m_per_s"] = or_null(limits.light_limit);
  return json.dump(1) + "\n";
}

}  // namespace blindcorner
