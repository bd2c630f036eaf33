// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/control/path_follower.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"
#include "planner/require_positive.h"

namespace blindcorner {
namespace {

/// A vehicle is at the path's end if it is this near and this slow, m and m/s.
constexpr double kArrivedWithin = 0.1, kArrivedSpeed = 0.05;
/// A vehicle that turns on the spot does so for heading errors beyond this.
constexpr double kTurnFirst = kPi / 4;

/// A limited vehicle that is faster than its profile by this much, m/s, is not accelerated by it.
constexpr double kTooFast = 0.5;
/// Speeds below which a safe stop steers straight ahead, m/s.
constexpr double kSlowCar = 1.0, kSlowRobot = 0.05;

double direction(const Eigen::Vector2d& vector) { return std::atan2(vector.y(), vector.x()); }

double wrapped(double angle) { return std::remainder(angle, 2 * kPi); }

/// Point of a path that goes on straight beyond its end.
Eigen::Vector2d point_at(const std::vector<PathPoint>& path, double arc_length) {
  const PathPoint sample = path_at(path, arc_length);
  const double beyond = std::max(0.0, arc_length - path.back().arc_length);
  return sample.position +
         beyond * Eigen::Vector2d(std::cos(sample.heading), std::sin(sample.heading));
}

/// Mean curvature between two arc lengths (Simpson's rule on four pieces), 1/m.
double mean_curvature(const std::vector<PathPoint>& path, double from, double to) {
  constexpr double kWeights[] = {1, 4, 2, 4, 1};
  double sum = 0;
  for (int i = 0; i < 5; ++i)
    sum += kWeights[i] * path_at(path, from + (to - from) * i / 4).curvature;
  return sum / 12;
}

}  // namespace

void PathFollowerOptions::validate() const {
  const auto positive = [](const char* field, double value) {
    require_positive("PathFollowerOptions", field, value);
  };
  positive("control_point_time", control_point_time);
  positive("control_point_distance", control_point_distance);
  positive("steering_gain", steering_gain);
  positive("speed_gain", speed_gain);
  if (!(delay >= 0)) throw Error("PathFollowerOptions.delay; accepted: seconds >= 0");
  profile.validate();
}

PathFollowerOptions follower_options(const VehicleLimits& limits) {
  PathFollowerOptions options;
  if (limits.wheelbase == 0) options.control_point_distance = 0.3;
  return options;
}

PathFollower::PathFollower(std::vector<PathPoint> path, const VehicleLimits& limits,
                           const VehicleState& state, const PathFollowerOptions& options)
    : path_(std::move(path)), limits_(limits), options_(options) {
  if (path_.size() < 2) {
    throw Error("PathFollower: a path of " + std::to_string(path_.size()) +
                " samples; accepted: 2 or more");
  }
  options_.validate();
  options_.profile.start = std::max(0.0, state.speed);
  profile_ = speed_profile(path_, limits_, options_.profile);
  arc_length_ =
      nearest_arc_length(path_, state.position, path_.front().arc_length, path_.back().arc_length);
}

void PathFollower::limit_speed(const std::vector<double>& limits, const VehicleState& state) {
  if (!limits.empty() && limits.size() != path_.size()) {
    throw Error("PathFollower: " + std::to_string(limits.size()) + " speed limits; accepted: " +
                std::to_string(path_.size()) + ", one for each sample");
  }
  const auto after =
      std::ranges::upper_bound(path_, arc_length_, {}, &PathPoint::arc_length) - path_.begin();
  const auto here = std::max<std::ptrdiff_t>(0, std::min(after, std::ssize(path_) - 1) - 1);
  limited_ = !limits.empty();
  SpeedProfileOptions ahead = options_.profile;
  ahead.start = std::max(0.0, state.speed);
  if (!limits.empty()) ahead.limits.assign(limits.begin() + here, limits.end());
  std::ranges::copy(
      speed_profile(std::span(path_).subspan(static_cast<std::size_t>(here)), limits_, ahead),
      profile_.begin() + here);
}

FollowerOutput PathFollower::steer(const VehicleState& state) {
  const double speed = std::abs(state.speed);
  const double reach =
      std::max(options_.control_point_distance, options_.control_point_time * speed);
  arc_length_ = nearest_arc_length(path_, state.position, arc_length_, arc_length_ + 2 * reach);
  const PathPoint here = path_at(path_, arc_length_);
  const Eigen::Vector2d control_point = point_at(path_, arc_length_ + reach);

  FollowerOutput output;
  output.arc_length = arc_length_;
  const Eigen::Vector2d to_left(-std::sin(here.heading), std::cos(here.heading));
  output.offset = to_left.dot(state.position - here.position);
  output.heading_error = wrapped(direction(control_point - state.position) - state.course());
  // A vehicle that is exactly on a curved path also sees the control point beside its course.
  const double expected = wrapped(direction(control_point - here.position) - here.heading);
  const double proportional =
      options_.steering_gain / reach * wrapped(output.heading_error - expected);

  // Over this window the steering reaches the path's curvature: it starts half a window earlier.
  const double ahead = arc_length_ + speed * options_.delay;
  const double angle = std::atan(limits_.wheelbase * path_at(path_, arc_length_ + reach).curvature -
                                 limits_.wheelbase * here.curvature);
  const double window = speed * std::abs(angle) / limits_.steering_rate;
  const double feed_forward = mean_curvature(path_, ahead - window / 2, ahead + window / 2);

  const double sharpest =
      std::min(limits_.curvature, limits_.friction / std::max(speed * speed, 1e-9));
  output.request.curvature = std::clamp(feed_forward + proportional, -sharpest, sharpest);
  return output;
}

PathFollower::SpeedCommand PathFollower::speed_command(double arc_length, double speed) const {
  const double end = path_.back().arc_length;
  const double ahead = arc_length + std::max(0.0, speed) * options_.delay;
  const auto after =
      std::upper_bound(path_.begin(), path_.end() - 1, ahead,
                       [](double s, const PathPoint& sample) { return s < sample.arc_length; });
  const auto i = static_cast<std::size_t>(std::max<std::ptrdiff_t>(1, after - path_.begin()));
  // v^2 is linear between samples: its slope is twice the feed-forward acceleration.
  const double length = std::max(path_[i].arc_length - path_[i - 1].arc_length, 1e-9);
  const double low = profile_[i - 1] * profile_[i - 1], high = profile_[i] * profile_[i];
  const double t = std::clamp((ahead - path_[i - 1].arc_length) / length, 0.0, 1.0);
  SpeedCommand command{std::sqrt(low + t * (high - low)), (high - low) / (2 * length)};
  // dv/ds times the actual speed, so that a vehicle that became too slow does not stop short.
  if (command.feed_forward < 0 && speed < command.target) {
    command.feed_forward *= std::max(0.0, speed) / command.target;
  }
  // Beyond a limit the profile rises again, but a vehicle that is still too fast does not follow
  // it.
  if (limited_ && command.feed_forward > 0) {
    command.feed_forward *= std::clamp(1 - (speed - command.target) / kTooFast, 0.0, 1.0);
  }
  if (ahead >= end) command.feed_forward = -limits_.friction;
  return command;
}

double PathFollower::acceleration(const SpeedCommand& command, double speed) const {
  return std::clamp(command.feed_forward + options_.speed_gain * (command.target - speed),
                    -limits_.friction, limits_.acceleration);
}

FollowerOutput PathFollower::follow(const VehicleState& state) {
  FollowerOutput output = steer(state);
  SpeedCommand command = speed_command(arc_length_, state.speed);
  if (limits_.wheelbase == 0 && std::abs(output.heading_error) > kTurnFirst) command = {};
  output.target_speed = command.target;
  output.request.acceleration = acceleration(command, state.speed);
  output.at_end = arc_length_ >= path_.back().arc_length - kArrivedWithin &&
                  std::abs(state.speed) <= kArrivedSpeed;
  return output;
}

FollowerOutput PathFollower::stop(const VehicleState& state) {
  FollowerOutput output = steer(state);
  const double lateral = state.speed * state.speed * output.request.curvature / limits_.friction;
  // At least half of the friction circle's square is left for braking: a vehicle at the limit would
  // otherwise never slow down.
  output.request.acceleration = -limits_.friction * std::sqrt(std::max(0.5, 1 - lateral * lateral));
  output.target_speed = 0;
  output.at_end = std::abs(state.speed) <= kArrivedSpeed;
  return output;
}

DriveRequest safe_stop(const VehicleState& state, const VehicleLimits& limits) {
  // For a slow car the yaw rate over the speed means nothing, and there is little to steer. A
  // robot's wheels set both.
  const double slow = limits.wheelbase > 0 ? kSlowCar : kSlowRobot;
  const double curvature = state.speed > slow ? state.yaw_rate / state.speed : 0;
  return {.acceleration = -limits.friction,
          .curvature = std::clamp(curvature, -limits.curvature, limits.curvature)};
}

}  // namespace blindcorner
