// SPDX-License-Identifier: Apache-2.0
/// Planning at every frame: the present plan is kept while it is good, and the reason is told.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "blindcorner/planner/path/path_planner.h"

namespace blindcorner {

enum class PlanAction {
  keep,    ///< the present plan
  replan,  ///< a new one
  stop,    ///< there is none: brake along what is left of the present one
};

/// Why. The first group keeps, the second plans anew, whatever comes of that.
enum class PlanReason {
  still_good,
  new_plan_no_better,  ///< it was time to look for a better one, and there is none
  at_goal,

  first_plan,
  goal_changed,
  off_path,  ///< the vehicle is too far from the path
  blocked,   ///< the path leads through an obstacle by now
  costlier,  ///< the rest of the path has become too risky
  refresh,   ///< plans become old: what has become free is seen in no other way
  stopped,   ///< there was no path in the last frame
};
/// "keep", "still_good", ... as logs have it.
std::string_view plan_action_word(PlanAction action);
std::string_view plan_reason_word(PlanReason reason);

struct ReplannerOptions {
  double max_offset = 0.5;       ///< m between vehicle and path
  double max_cost_growth = 0.1;  ///< of the rest of the path, relative, since it was planned
  int refresh_after = 20;        ///< frames after which a kept plan is questioned; 0: never
  double goal_tolerance =
      0.1;  ///< m: the vehicle is at its goal; a goal that moved by less is not new
  double deceleration = 4.0;  ///< m/s^2 of a safe stop: half of what dry tyres (mu 0.9) can do
  double stop_margin = 0.5;   ///< m between a safe stop's end and the first place that is blocked

  /// Throws Error naming the field.
  void validate() const;
};

struct PlanUpdate {
  PlanAction action = PlanAction::stop;
  PlanReason reason = PlanReason::first_plan;
  PathStatus status = PathStatus::no_path;  ///< of the search, where there was one; else found
  Path path;              ///< to follow, from the start of the plan; of a stop the free stretch
  double arc_length = 0;  ///< m along `path`, where the vehicle is
  /// m/s at each of the path's points: sqrt(2 deceleration (end - arc length)) of a stop, 0 at its
  /// end; infinity otherwise.
  std::vector<double> speed_limit;
  bool stops_too_late = false;  ///< a stop from the present speed ends behind the path's end
  double time = 0;              ///< s, of this update

  /// One line for a log: "keep: still_good", "stop: blocked, no_path".
  std::string text() const;
};

class Replanner {
 public:
  explicit Replanner(const PathPlannerOptions& planner = {}, const ReplannerOptions& options = {});

  /// Decides for one frame. `grid` as `PathPlanner::grid` makes it; `speed` forward, m/s.
  PlanUpdate update(const PlanningGrid& grid, const PlanarPose& vehicle, double speed,
                    const Eigen::Vector2d& goal, std::optional<double> goal_heading = std::nullopt);
  const PathPlanner& planner() const { return planner_; }
  /// Forgets the present plan.
  void reset();

 private:
  PlanReason assess(const PlanningGrid& grid, const PlanarPose& vehicle,
                    const Eigen::Vector2d& goal);
  void keep(const PlanarPose& vehicle, PlanUpdate& update);
  void decide(const PlanningGrid& grid, const PlanarPose& vehicle, double speed, Path path,
              PlanUpdate& update);
  void stop(const PlanningGrid& grid, const PlanarPose& vehicle, double speed, PlanUpdate& update);

  PathPlanner planner_;
  ReplannerOptions options_;
  std::optional<Path> plan_;
  std::vector<double> planned_cost_;  ///< m, from each point of the plan to its end, when planned
  Eigen::Vector2d goal_ = Eigen::Vector2d::Zero();
  double arc_length_ = 0;  ///< m along the plan, where the vehicle is
  int age_ = 0;            ///< frames since the plan was made or questioned
  bool stopped_ = false;
};

}  // namespace blindcorner
