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

/// Why. The first group keeps, the second plans anew, whatever comes of that, the third stops.
enum class PlanReason {
  still_good,
  new_plan_no_better,  ///< it was time to look for a better one, and there is none

  first_plan,
  goal_changed,  ///< or its heading, since the present plan was made
  off_path,      ///< the vehicle is too far from the path
  blocked,       ///< the path leads through an obstacle by now
  crossed,       ///< what moves will be on the path when the vehicle comes there
  costlier,      ///< the rest of the path has become too risky
  refresh,       ///< plans become old: what has become free is seen in no other way
  stopped,       ///< there was no path in the last frame

  at_goal,     ///< the plan is dropped
  not_finite,  ///< the vehicle's pose or speed, or the goal, is not a number
};
/// "keep", "still_good", ... as logs have it.
std::string_view plan_action_word(PlanAction action);
std::string_view plan_reason_word(PlanReason reason);

struct ReplannerOptions {
  double max_offset = 0.5;       ///< m between vehicle and path
  double max_cost_growth = 0.1;  ///< of the rest of the path, relative, since it was planned
  int refresh_after = 20;        ///< frames after which a kept plan is questioned; 0: never
  /// m: the vehicle is at its goal; a goal that is less than this from the plan's is not new.
  double goal_tolerance = 0.1;
  /// rad: likewise of the heading at the goal. What a car of 4.5 m shows at its ends is 0.1 m, as
  /// the goal's tolerance.
  double goal_heading_tolerance = 0.05;
  double deceleration = 4.0;  ///< m/s^2 of a safe stop: half of what dry tyres (mu 0.9) can do
  double stop_margin = 0.5;   ///< m between a safe stop's end and the first place that is blocked

  /// Throws Error naming the field.
  void validate() const;
};

struct PlanUpdate {
  PlanAction action = PlanAction::stop;
  PlanReason reason = PlanReason::first_plan;
  PathStatus status = PathStatus::no_path;  ///< of the search, where there was one; else found
  Path path;              ///< to follow, from the start of the plan; of a stop the free stretch,
                          ///< without points when nothing is known of where the vehicle is
  double arc_length = 0;  ///< m along `path`, where the vehicle is
  bool stops_too_late = false;  ///< a stop with `deceleration` ends behind the path's end
  double time = 0;              ///< s, of this update

  /// One line for a log: "keep: still_good", "stop: blocked, no_path".
  std::string text() const;
};

class Replanner {
 public:
  /// `body`: the vehicle without the room that the planner's footprint leaves beside it. A plan is
  /// kept until the body itself would touch something: what is seen a little nearer than before is
  /// no reason for another one.
  explicit Replanner(const PathPlannerOptions& planner = {}, const VehicleFootprint& body = {},
                     const ReplannerOptions& options = {});

  /// Decides for one frame; stops where a number is not finite. `grid` as `PathPlanner::grid` makes
  /// it; `speed` forward, m/s; `curvature` that the vehicle drives now, 1/m: new plans begin with
  /// both. Where no path keeps away from the movers there is still one to brake on.
  PlanUpdate update(const PlanningGrid& grid, const PlanarPose& vehicle, double speed,
                    const PathGoal& goal, double curvature = 0, std::span<const Mover> movers = {});
  const PathPlanner& planner() const { return planner_; }
  /// Forgets the present plan.
  void reset();

 private:
  PlanReason assess(const PlanningGrid& grid, const PlanarPose& vehicle, const PathGoal& goal,
                    const MoverAvoidance& avoidance);
  bool crossed(const PlanarPose& vehicle, const MoverAvoidance& avoidance) const;
  bool is_new_goal(const PathGoal& goal) const;
  void adopt(const PlanningGrid& grid, Path path);
  void keep(PlanUpdate& update);
  void stand(const PlanarPose& vehicle, double speed, PlanUpdate& update);
  void halt(const PlanningGrid& grid, const PlanarPose& vehicle, double speed, PlanUpdate& update);
  void decide(const PlanningGrid& grid, const PlanarPose& vehicle, double speed, Path path,
              PlanUpdate& update);
  void stop(const PlanningGrid& grid, const PlanarPose& vehicle, double speed, PlanUpdate& update);

  PathPlanner planner_;
  VehicleFootprint body_;
  ReplannerOptions options_;
  std::optional<Path> plan_;
  std::vector<double> planned_cost_;  ///< m, from each point of the plan to its end, when planned
  PathGoal goal_;                     ///< of the plan
  double arc_length_ = 0;             ///< m along the plan, where the vehicle is
  int age_ = 0;                       ///< frames since the plan was made or questioned
  bool stopped_ = false;
};

}  // namespace blindcorner
