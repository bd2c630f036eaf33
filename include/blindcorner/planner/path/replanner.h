// SPDX-License-Identifier: Apache-2.0
/// Planning at every frame: a good plan is kept, and the reason for each decision is told.
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
  replan,  ///< a new plan
  stop,    ///< there is no plan: brake along the rest of the present one
};

/// Reason of an action. The first group keeps the plan. The second group asks for a new plan, which
/// may fail. The third group stops.
enum class PlanReason {
  still_good,
  new_plan_no_better,  ///< a better plan was looked for and not found

  first_plan,
  goal_changed,  ///< or its heading, since the present plan was made
  off_path,      ///< the vehicle is too far from the path
  blocked,       ///< the path now leads through an obstacle
  crossed,       ///< a mover will be on the path when the vehicle gets there
  costlier,      ///< the rest of the path has become too risky
  refresh,       ///< the plan is old: only a new plan uses cells that became free
  stopped,       ///< the last frame had no path

  at_goal,     ///< the plan is dropped
  not_finite,  ///< the vehicle's pose, speed or curvature, or the goal, is not a number
};
/// "keep", "still_good", ... as written in logs.
std::string_view plan_action_word(PlanAction action);
std::string_view plan_reason_word(PlanReason reason);

struct ReplannerOptions {
  double max_offset = 0.5;       ///< m between vehicle and path
  double max_cost_growth = 0.1;  ///< of the rest of the path, relative, since it was planned
  int refresh_after = 20;        ///< frames after which a kept plan is questioned; 0: never
  /// m: the vehicle is at its goal within this distance, and a goal within this distance of the
  /// plan's goal is not new.
  double goal_tolerance = 0.1;
  /// rad: a goal heading within this angle of the plan's is not new. At the ends of a car of 4.5 m
  /// this is 0.1 m, as is the goal's tolerance.
  double goal_heading_tolerance = 0.05;
  double deceleration = 4.0;  ///< m/s^2 of a safe stop: half of what dry tyres (mu 0.9) can do
  double stop_margin = 0.5;   ///< m between the end of a safe stop and the first blocked place

  /// Throws Error naming the field.
  void validate() const;
};

struct PlanUpdate {
  PlanAction action = PlanAction::stop;
  PlanReason reason = PlanReason::first_plan;
  PathStatus status = PathStatus::no_path;  ///< of the search if there was one; otherwise found
  Path path;  ///< to follow, from the plan's start. Of a stop: the free stretch, up to where
              ///< braking ends; no points if the vehicle's place is unknown
  double arc_length = 0;        ///< m along `path`, the vehicle's place
  bool stops_too_late = false;  ///< a stop with `deceleration` passes the first blocked place, the
                                ///< path's end by `stop_margin`, or the goal's tolerance
  double time = 0;              ///< s, run time of this update

  /// One line for a log: "keep: still_good", "stop: blocked, no_path".
  std::string text() const;
};

class Replanner {
 public:
  /// `body`: the vehicle without the room that the planner's footprint leaves beside it. A plan is
  /// kept until the body itself would touch something: an obstacle that appears slightly nearer
  /// than before is no reason for a new plan.
  explicit Replanner(const PathPlannerOptions& planner = {}, const VehicleFootprint& body = {},
                     const ReplannerOptions& options = {});

  /// Decides for one frame; stops if a number is not finite. `grid` is made by `PathPlanner::grid`.
  /// `speed` is the forward speed, m/s, and `curvature` the present curvature, 1/m: new plans begin
  /// with both. If no path avoids the movers, there is still a path to brake on.
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
  std::vector<double> planned_cost_;  ///< m, from each plan point to the plan's end, when planned
  PathGoal goal_;                     ///< of the plan
  double arc_length_ = 0;             ///< m along the plan, the vehicle's place
  int age_ = 0;                       ///< frames since the plan was made or questioned
  bool stopped_ = false;
};

}  // namespace blindcorner
