// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/planner/path/replanner.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "blindcorner/forward/constants.h"
#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
/// Largest distance between the places at which a plan is checked in every frame, in cells: a disc
/// of the radius of a cell reaches 1/30 of a cell into a corner between two of them.
constexpr double kLookedAt = 0.5;
/// The same for movers, m: less than half of any vehicle that moves among them.
constexpr double kMoverStep = 0.25;

void check_option(bool fine, const char* field, double value, const char* accepted) {
  if (fine && std::isfinite(value)) return;
  throw Error(std::string("ReplannerOptions.") + field + " = " + std::to_string(value) +
              "; accepted: " + accepted);
}

/// Cost from each point of a path to its end, m.
std::vector<double> costs_to_end(const PlanningGrid& grid, const Path& path) {
  const GridGeometry& geometry = grid.geometry();
  std::vector<double> costs(path.points.size(), 0);
  for (std::size_t i = costs.size() - 1; i-- > 0;) {
    const PathPoint &a = path.points[i], &b = path.points[i + 1];
    const Cell cell = geometry.cell_at(0.5 * (a.position + b.position));
    const double factor = geometry.contains(cell) ? grid.cost_factor(geometry.index(cell)) : 1;
    costs[i] = costs[i + 1] + factor * (b.arc_length - a.arc_length);
  }
  return costs;
}

/// Index of the first point at or after an arc length.
std::size_t first_after(const Path& path, double arc_length) {
  const auto after = std::ranges::lower_bound(path.points, arc_length, {}, &PathPoint::arc_length);
  return static_cast<std::size_t>(
      std::min<std::ptrdiff_t>(after - path.points.begin(), std::ssize(path.points) - 1));
}

/// Arc length of the first place, from `from` on, where the vehicle touches an obstacle; infinite
/// if there is none. An obstacle that the vehicle is in already counts where the vehicle gets
/// deeper.
double first_blocked(const PlanningGrid& grid, const VehicleFootprint& body, const Path& path,
                     double from) {
  constexpr double kDeeper = 0.01;  // m
  const double step = kLookedAt * grid.geometry().cell_size;
  const PathPoint begin = path.at(from);
  std::vector<double> allowed = grid.overlaps(body, body_on_path(body, begin));
  for (double s = from;; s = std::min(s + step, path.points.back().arc_length)) {
    const PlanarPose pose = body_on_path(body, path.at(s));
    if (!grid.is_free(body, pose)) {
      const std::vector<double> now = grid.overlaps(body, pose);
      for (std::size_t disc = 0; disc < now.size(); ++disc) {
        if (now[disc] > allowed[disc] + kDeeper) return s;
        allowed[disc] = std::min(allowed[disc], now[disc]);
      }
      if (!grid.geometry().contains(grid.geometry().cell_at(pose.position))) return s;
    } else {
      std::ranges::fill(allowed, 0.0);
    }
    if (s >= path.points.back().arc_length) return kNever;
  }
}

/// A path to where the vehicle stands.
Path standing(const PlanarPose& vehicle) {
  Path path;
  path.status = PathStatus::found;
  path.points = {{vehicle.position, vehicle.heading, 0, 0}};
  return path;
}

bool is_finite(const PlanarPose& pose) {
  return pose.position.allFinite() && std::isfinite(pose.heading);
}

/// A path's points up to an arc length, with a point there.
Path cut_at(const Path& path, double end) {
  Path cut = path;
  cut.points.resize(first_after(path, end));
  cut.points.push_back(path.at(end));
  cut.length = end;
  return cut;
}

}  // namespace

std::string_view plan_action_word(PlanAction action) {
  switch (action) {
    case PlanAction::keep:
      return "keep";
    case PlanAction::replan:
      return "replan";
    case PlanAction::stop:
      return "stop";
  }
  return "";
}

std::string_view plan_reason_word(PlanReason reason) {
  switch (reason) {
    case PlanReason::still_good:
      return "still_good";
    case PlanReason::new_plan_no_better:
      return "new_plan_no_better";
    case PlanReason::first_plan:
      return "first_plan";
    case PlanReason::goal_changed:
      return "goal_changed";
    case PlanReason::off_path:
      return "off_path";
    case PlanReason::blocked:
      return "blocked";
    case PlanReason::crossed:
      return "crossed";
    case PlanReason::costlier:
      return "costlier";
    case PlanReason::refresh:
      return "refresh";
    case PlanReason::stopped:
      return "stopped";
    case PlanReason::at_goal:
      return "at_goal";
    case PlanReason::not_finite:
      return "not_finite";
  }
  return "";
}

void ReplannerOptions::validate() const {
  check_option(max_offset > 0, "max_offset", max_offset, "a number of metres > 0");
  check_option(max_cost_growth >= 0, "max_cost_growth", max_cost_growth, "a number >= 0");
  check_option(refresh_after >= 0, "refresh_after", refresh_after, "a number of frames >= 0");
  check_option(goal_tolerance >= 0, "goal_tolerance", goal_tolerance, "a number of metres >= 0");
  check_option(goal_heading_tolerance >= 0, "goal_heading_tolerance", goal_heading_tolerance,
               "radians >= 0");
  check_option(deceleration > 0, "deceleration", deceleration, "a number of m/s^2 > 0");
  check_option(stop_margin >= 0, "stop_margin", stop_margin, "a number of metres >= 0");
}

std::string PlanUpdate::text() const {
  std::string text(plan_action_word(action));
  text += ": ";
  text += plan_reason_word(reason);
  if (status != PathStatus::found) {
    text += ", ";
    text += path_status_word(status);
  }
  if (stops_too_late) text += ", too fast to stop in time";
  return text;
}

Replanner::Replanner(const PathPlannerOptions& planner, const VehicleFootprint& body,
                     const ReplannerOptions& options)
    : planner_(planner), body_(body), options_(options) {
  options.validate();
}

void Replanner::reset() {
  plan_.reset();
  planned_cost_.clear();
  stopped_ = false;
  arc_length_ = 0;
  age_ = 0;
}

PlanUpdate Replanner::update(const PlanningGrid& grid, const PlanarPose& vehicle, double speed,
                             const PathGoal& goal, double curvature,
                             std::span<const Mover> movers) {
  const auto begin = std::chrono::steady_clock::now();
  PlanUpdate update;
  update.status = PathStatus::found;
  const bool finite = is_finite(vehicle) && std::isfinite(speed) && goal.point.allFinite() &&
                      goal.line_to.value_or(goal.point).allFinite() &&
                      std::isfinite(goal.heading.value_or(0)) && std::isfinite(curvature);
  update.reason = finite ? assess(grid, vehicle, goal, {movers, speed}) : PlanReason::not_finite;
  if (update.reason == PlanReason::not_finite) {
    halt(grid, vehicle, speed, update);
  } else if (update.reason == PlanReason::at_goal) {
    stand(vehicle, speed, update);
  } else if (update.reason == PlanReason::still_good) {
    ++age_;
    keep(update);
  } else {
    PathRequest request{vehicle.position, vehicle.heading, goal, curvature, speed, movers};
    Path path = planner_.plan(grid, request);
    if (!path.found() && !movers.empty() && update.reason != PlanReason::crossed) {
      request.movers = {};
      path = planner_.plan(grid, request);
    }
    update.status = path.status;
    decide(grid, vehicle, speed, std::move(path), update);
    if (update.action == PlanAction::replan) goal_ = goal;
  }
  update.time = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return update;
}

/// Whether the goal is new. It is compared with the goal that the plan was made for and not with
/// that of the last frame, because a goal may creep.
bool Replanner::is_new_goal(const PathGoal& goal) const {
  const auto moved = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return (a - b).norm() > options_.goal_tolerance;
  };
  if (moved(goal.point, goal_.point) || goal.line_to.has_value() != goal_.line_to.has_value() ||
      goal.heading.has_value() != goal_.heading.has_value()) {
    return true;
  }
  if (goal.line_to && moved(*goal.line_to, *goal_.line_to)) return true;
  const double turn = std::remainder(goal.heading.value_or(0) - goal_.heading.value_or(0), 2 * kPi);
  return std::abs(turn) > options_.goal_heading_tolerance;
}

/// Whether a mover will be on the plan when the vehicle comes there.
bool Replanner::crossed(const PlanarPose& vehicle, const MoverAvoidance& avoidance) const {
  if (avoidance.movers.empty()) return false;
  for (double s = arc_length_; s <= plan_->points.back().arc_length; s += kMoverStep) {
    const PlanarPose then = body_on_path(body_, plan_->at(s));
    if (avoidance.meets(body_, then, s - arc_length_, vehicle)) return true;
  }
  return false;
}

/// What speaks against the present plan, the gravest first.
PlanReason Replanner::assess(const PlanningGrid& grid, const PlanarPose& vehicle,
                             const PathGoal& goal, const MoverAvoidance& avoidance) {
  const bool at_point =
      !goal.line_to && (vehicle.position - goal.point).norm() <= options_.goal_tolerance;
  if (at_point) return PlanReason::at_goal;
  if (!plan_) return stopped_ ? PlanReason::stopped : PlanReason::first_plan;
  arc_length_ = plan_->nearest(vehicle.position, std::max(0.0, arc_length_ - options_.max_offset));
  if (stopped_) return PlanReason::stopped;
  if (is_new_goal(goal)) return PlanReason::goal_changed;
  if ((plan_->at(arc_length_).position - vehicle.position).norm() > options_.max_offset) {
    return PlanReason::off_path;
  }
  if (first_blocked(grid, body_, *plan_, arc_length_) < kNever) return PlanReason::blocked;
  if (crossed(vehicle, avoidance)) return PlanReason::crossed;
  const std::size_t here = first_after(*plan_, arc_length_);
  if (costs_to_end(grid, *plan_)[here] > (1 + options_.max_cost_growth) * planned_cost_[here]) {
    return PlanReason::costlier;
  }
  if (options_.refresh_after > 0 && age_ >= options_.refresh_after) return PlanReason::refresh;
  return PlanReason::still_good;
}

void Replanner::keep(PlanUpdate& update) {
  update.action = PlanAction::keep;
  update.status = PathStatus::found;
  update.path = *plan_;
  update.arc_length = arc_length_;
}

/// Stands at the goal. Another goal is planned for as if it were the first.
void Replanner::stand(const PlanarPose& vehicle, double speed, PlanUpdate& update) {
  reset();
  update.action = PlanAction::stop;
  update.path = standing(vehicle);
  update.stops_too_late = 0.5 * speed * speed / options_.deceleration > options_.goal_tolerance;
}

/// Brakes along the plan from where the vehicle was seen last, along all of it if the speed is not
/// known.
void Replanner::halt(const PlanningGrid& grid, const PlanarPose& vehicle, double speed,
                     PlanUpdate& update) {
  const bool placed = is_finite(vehicle);
  if (!placed && !plan_) {
    update.action = PlanAction::stop;
    update.stops_too_late = true;
    stopped_ = true;
    return;
  }
  if (placed && plan_) {
    arc_length_ =
        plan_->nearest(vehicle.position, std::max(0.0, arc_length_ - options_.max_offset));
  }
  PlanarPose at = vehicle;
  if (!placed) at = {plan_->at(arc_length_).position, plan_->at(arc_length_).heading};
  stop(grid, at, std::isfinite(speed) ? speed : kNever, update);
}

void Replanner::adopt(const PlanningGrid& grid, Path path) {
  plan_ = std::move(path);
  planned_cost_ = costs_to_end(grid, *plan_);
  arc_length_ = 0;
}

/// Takes a new path, keeps the present one, or stops.
void Replanner::decide(const PlanningGrid& grid, const PlanarPose& vehicle, double speed, Path path,
                       PlanUpdate& update) {
  // If there is no other plan, the vehicle brakes on this one for the mover that crosses it.
  const bool no_other = update.reason == PlanReason::crossed && !path.found();
  const bool could_keep =
      update.reason == PlanReason::refresh || update.reason == PlanReason::costlier;
  if (could_keep || no_other) {
    const std::vector<double> costs = costs_to_end(grid, *plan_);
    const double rest = costs[first_after(*plan_, arc_length_)];
    if (!path.found() || path.cost * (1 + options_.max_cost_growth) > rest) {
      planned_cost_ = costs;
      age_ = 0;
      update.reason = PlanReason::new_plan_no_better;
      return keep(update);
    }
  }
  if (!path.found()) return stop(grid, vehicle, speed, update);
  adopt(grid, std::move(path));
  age_ = 0;
  stopped_ = false;
  update.action = PlanAction::replan;
  update.path = *plan_;
}

/// Brakes along the free part of the present plan, or where the vehicle stands.
void Replanner::stop(const PlanningGrid& grid, const PlanarPose& vehicle, double speed,
                     PlanUpdate& update) {
  update.action = PlanAction::stop;
  if (!plan_ || (plan_->at(arc_length_).position - vehicle.position).norm() > options_.max_offset) {
    adopt(grid, standing(vehicle));
  }
  const double braking = 0.5 * speed * speed / options_.deceleration;
  const double blocked = first_blocked(grid, body_, *plan_, arc_length_);
  const double free_end = std::max(
      arc_length_, std::min(plan_->points.back().arc_length, blocked - options_.stop_margin));
  const double end = std::min(free_end, arc_length_ + braking);
  update.stops_too_late = arc_length_ + braking > free_end + options_.stop_margin;
  // The whole free stretch is kept, so that the next frame can still brake along it.
  update.path = cut_at(*plan_, end);
  plan_ = cut_at(*plan_, free_end);
  planned_cost_ = costs_to_end(grid, *plan_);
  stopped_ = true;
  update.arc_length = arc_length_;
}

}  // namespace blindcorner
