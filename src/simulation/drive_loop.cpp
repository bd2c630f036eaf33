// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/drive_loop.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <deque>
#include <limits>
#include <random>
#include <utility>

#include "blindcorner/planner/control/occluded_speed.h"
#include "blindcorner/planner/control/path_follower.h"
#include "blindcorner/planner/control/path_outlook.h"
#include "blindcorner/planner/control/predicted_contact.h"
#include "blindcorner/planner/control/published_controller.h"
#include "blindcorner/planner/control/safe_speed.h"
#include "blindcorner/planner/control/traffic.h"
#include "blindcorner/planner/grid/line_of_sight.h"
#include "blindcorner/planner/grid/occupancy_grid.h"
#include "blindcorner/planner/grid/pose_hypotheses.h"
#include "blindcorner/planner/path/replanner.h"
#include "blindcorner/planner/vehicles/vehicle.h"
#include "blindcorner/simulation/perception.h"
#include "blindcorner/simulation/true_world.h"
#include "simulation/convex_distance.h"
#include "simulation/drive_setup.h"
#include "simulation/movers.h"
#include "simulation/sightings.h"

namespace blindcorner {
namespace {

using Clock = std::chrono::steady_clock;
using Eigen::Vector2d;

/// Control period, s: 20 cm at the highest speed of a street.
constexpr double kStep = 0.02;
/// A vehicle that stands this long without a drivable path has stopped for good, s.
constexpr double kGivesUpAfter = 3.0;
/// A vehicle slower than this counts as standing, m/s: it moves at most 6 cm until it gives up.
constexpr double kStands = 0.02;
/// Braking that is hardly felt, a share of the friction limit.
constexpr double kGentle = 0.05;
/// Interval at which the speed limits for road users out of sight are computed again, s.
constexpr double kLooksAgain = 0.3;
/// A vehicle that starts at speed has looked around over this distance before its start, m.
constexpr double kLookedBefore = 20;
/// Log likelihood ratio of a cell in which the known scene has a wall: a thousand to one.
constexpr double kWallEvidence = 6.9;
/// Distance between the photon seeds of two frames of one drive: a prime beyond the frames' number.
constexpr std::uint64_t kFrameSeeds = 1'000'003;
/// A random sequence of its own decides which frames are missing or late.
constexpr std::uint64_t kFaultSeed = 0x9e3779b97f4a7c15;

/// Adds the wall-clock time of its own life to a sum, ms.
class StageTimer {
 public:
  explicit StageTimer(double& sum) : sum_(sum) {}
  ~StageTimer() {
    sum_ += std::chrono::duration<double, std::milli>(Clock::now() - start_).count();
  }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  double& sum_;
  Clock::time_point start_ = Clock::now();
};

/// A sensor frame on its way to the vehicle's computer.
struct SensedEvent {
  double capture_time = 0;  ///< s
  double arrival = 0;       ///< s
  std::size_t frame = 0;
  VehicleState vehicle;  ///< true state
};

/// The perception's answer to a frame, and the time at which it is ready.
struct AnswerEvent {
  double capture_time = 0;  ///< s
  double ready = 0;         ///< s
  PerceptionAnswer answer;
};

class DriveLoop {
 public:
  DriveLoop(const Drive& drive, const SimulatedSensor& sensor, const DriveOptions& options);
  DriveResult run();

 private:
  void capture_frame();
  void take_frame(const SensedEvent& event);
  void take_answer(const AnswerEvent& event);
  void update_map(const LineOfSightScan* scan, const AnswerEvent* event);
  void plan();
  void plan_as_published(const PlanningGrid& planning);
  void follow(const PlanUpdate& update);
  void limit_speed(const PlanningGrid& planning);
  void limit_for_unseen(std::vector<double>& limits, double here);
  void look_before_start();
  void step();
  void note_frame();
  bool finished();
  void forget_maps();
  StandingAndMoving split(const AnswerEvent& event) const;
  std::string braking_for() const;
  void mark_walls();

  VehicleState state() const { return vehicle_.state(); }
  /// The vehicle's estimate of its own state. Everything that it does with a map starts from here.
  VehicleState believed() const { return world_.believed(state()); }
  Polygon outline() const;
  std::vector<double> occupancy() const;
  std::vector<double> within_lane() const;
  /// Curvature that the wheels are turned to, 1/m; 0 for a vehicle that turns on the spot.
  double steered_curvature() const {
    return limits_.wheelbase > 0 ? std::tan(believed().steering_angle) / limits_.wheelbase : 0.0;
  }
  double speed() const { return world_.speed(); }
  PathGoal goal() const;
  bool passed_goal();

  const Drive& drive_;
  const SimulatedSensor& sensor_;
  DriveOptions options_;
  TrueWorld world_;
  std::unique_ptr<Perception> perception_;
  double delay_;
  LineOfSight sight_;
  Sightings sightings_;
  Scene map_scene_;  ///< with the hidden objects as the map represents them
  OccupancyGrid grid_;
  PoseHypotheses hypotheses_;
  Vehicle vehicle_;
  VehicleLimits limits_;
  VehicleFootprint body_;  ///< without a margin
  Replanner replanner_;
  std::optional<PublishedController> published_;  ///< empty: this project's own planner drives
  std::optional<PathFollower> follower_;
  std::optional<PathOutlook> outlook_;   ///< along the follower's path; only for safe speeds
  std::optional<LineOfSight> around_;    ///< from the same place, in all directions
  std::optional<OccludedSpeed> unseen_;  ///< for road users expected out of sight
  std::vector<double> unseen_limits_;    ///< m/s, at the samples of the follower's path
  double unseen_limits_time_ = 0;        ///< s
  double unseen_time_ = 0;               ///< s
  bool no_way_ = true;                   ///< no path leads to the goal
  bool brake_ = true;                    ///< no path to follow, or one that ends too soon
  bool held_ = false;                    ///< the body would touch something beside the path
  TrafficDecision traffic_;
  double acceleration_ = 0;  ///< m/s^2, asked for in the last control period
  std::mt19937_64 faults_;

  double time_ = 0;             ///< s
  double map_time_ = 0;         ///< s, time of the map's last update
  double busy_until_ = 0;       ///< s; until then perception works on a frame
  bool started_ = false;        ///< perception has answered a frame
  double standing_since_ = -1;  ///< s; negative: the vehicle drives, or has a plan
  double clearance_ = std::numeric_limits<double>::infinity();  ///< m, least since the last frame
  VehicleState sensed_from_;  ///< true state at the time of the frame that perception works on
  AnswerEvent perceived_;     ///< last answer before a hidden object came in direct sight
  std::size_t next_goal_ = 0;
  Vector2d passed_from_;  ///< m, the vehicle's estimated position when the goal was last checked
  std::deque<SensedEvent> arriving_;  ///< in order of arrival
  std::deque<AnswerEvent> answers_;   ///< in order of readiness
  std::optional<AnswerEvent> latest_;
  std::vector<double> occupancy_;  ///< that the last plan used
  std::string plan_text_;
  std::vector<Vector2d> path_;
  double target_speed_ = 0;
  DriveTimes times_;
  DriveResult result_;
};

DriveLoop::DriveLoop(const Drive& drive, const SimulatedSensor& sensor, const DriveOptions& options)
    : drive_(drive),
      sensor_(sensor),
      options_(options),
      world_(drive, options.seed, options.speed),
      perception_(make_perception(
          options.perception,
          {sensor.scene(), drive.motion, options.fitter,
           [this](double time) { return world_.believed_hidden(sensed_from_, time); },
           options.injected_error, options.seed, options.networks})),
      delay_(declared_delay(drive, options.perception)),
      sight_(drive.scene, drive.map, sight_options(drive)),
      sightings_(drive.scene, drive.motion),
      map_scene_(map_scene(drive.scene, obstacle_disc(drive, perception_->disc_radius()))),
      grid_(drive.map, map_scene_, drive.motion, occupancy_options(drive)),
      hypotheses_(map_scene_, drive.map),
      vehicle_(model_of(drive.vehicle)),
      limits_(vehicle_.model().limits()),
      body_(footprint_of(vehicle_.model())),
      replanner_(planner_options(drive.vehicle, vehicle_.model(), speed()), body_,
                 replanner_options(drive)),
      faults_(options.seed ^ kFaultSeed) {
  VehicleState start;
  start.position = world_.vehicle_start();
  start.yaw = drive.vehicle.start_yaw;
  start.speed = drive.vehicle.start_speed.value_or(speed());
  vehicle_.place(start);
  passed_from_ = believed().position;
  if (drive.controller == DriveController::published) {
    published_.emplace(limits_, PublishedControllerOptions::of_length(drive.vehicle.length));
  }
  mark_walls();
  if (perception_->expects_unseen()) {
    LineOfSightOptions all_round = sight_options(drive);
    all_round.field_of_view = LineOfSightOptions{}.field_of_view;
    around_.emplace(drive.scene, drive.map, all_round);
    unseen_.emplace(*around_, drive.map, world_.wall_cells(), vehicle_.model().footprint(),
                    drive.sensor.T_vehicle_sensor, occluded_speed_options(drive));
    look_before_start();
  }
  result_.wanted_speed = speed();
  result_.trace_step = kStep;
}

/// A vehicle that starts at speed is taken to have driven straight up to its start.
void DriveLoop::look_before_start() {
  const VehicleState start = believed();
  const double step = drive_.vehicle.length / 2;
  if (!(start.speed > 0)) return;
  for (double before = kLookedBefore; before > 0; before -= step) {
    VehicleState state = start;
    state.position -= before * Vector2d(std::cos(start.yaw), std::sin(start.yaw));
    unseen_->see(step / start.speed, state);
  }
}

/// Enters the walls of the known scene into the map, which therefore has them from the start.
void DriveLoop::mark_walls() {
  for (const Cell& cell : world_.wall_cells()) grid_.add_static_evidence(cell, kWallEvidence);
}

Polygon DriveLoop::outline() const {
  const VehicleRectangle body = vehicle_.model().footprint();
  const Transform T = T_world_vehicle(state());
  Polygon corners;
  for (const auto& [x, y] : {std::pair(-0.5, -0.5), {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}) {
    const Eigen::Vector3d corner(body.center_x + x * body.length, y * body.width, 0);
    corners.push_back((T * corner).head<2>());
  }
  return corners;
}

std::vector<double> DriveLoop::occupancy() const {
  std::vector<double> probabilities = grid_.probabilities();
  for (std::size_t i = 0; i < probabilities.size(); ++i) {
    if (!grid_.known(drive_.map.cell(i))) {
      probabilities[i] = std::numeric_limits<double>::quiet_NaN();
    }
  }
  return probabilities;
}

/// Occupancy for the planner, to which cells beside the lane are occupied.
std::vector<double> DriveLoop::within_lane() const {
  std::vector<double> open = occupancy_;
  if (!drive_.lane) return open;
  for (std::size_t i = 0; i < open.size(); ++i) {
    if (!drive_.lane->contains(drive_.map.center(drive_.map.cell(i)))) open[i] = 1;
  }
  return open;
}

/// Captures the sensor's frame of this moment. The frame arrives now, later or never.
void DriveLoop::capture_frame() {
  if (options_.progress) options_.progress(time_);
  SensedEvent event;
  event.capture_time = event.arrival = time_;
  event.frame = result_.frames.size();
  event.vehicle = state();
  std::uniform_real_distribution<double> chance(0, 1);
  const bool missing = chance(faults_) < drive_.sensor.missing_share;
  if (chance(faults_) < drive_.sensor.late_share) event.arrival += drive_.sensor.late_by;
  note_frame();
  DriveFrame& frame = result_.frames.back();
  frame.T_world_sensor = T_world_vehicle(event.vehicle) * drive_.sensor.T_vehicle_sensor;
  frame.arrival = event.arrival;
  if (missing) {
    frame.fate = FrameFate::missing;
    return;
  }
  const auto later = std::ranges::find_if(
      arriving_, [&](const SensedEvent& other) { return other.arrival > event.arrival; });
  arriving_.insert(later, event);
}

/// Notes the vehicle's state and the truth when a frame is due.
void DriveLoop::note_frame() {
  if (!options_.keep_pictures) forget_maps();
  DriveFrame frame;
  frame.time = time_;
  frame.vehicle = state();
  frame.truth = world_.hidden(time_);
  frame.clearance = std::min(clearance_, world_.clearance(outline(), time_));
  clearance_ = std::numeric_limits<double>::infinity();
  result_.frames.push_back(std::move(frame));
  times_ = {};
}

/// Drops maps that last_map() cannot find any more. While frames are on their way, their fate is
/// open, and all maps stay.
void DriveLoop::forget_maps() {
  if (!arriving_.empty()) return;
  const DriveFrame* last = last_map(result_);
  for (DriveFrame& frame : result_.frames) {
    if (&frame != last) frame.occupancy = std::vector<double>();
  }
}

/// The map takes what is in direct sight at once. The histograms go to perception, unless
/// perception is busy or hidden objects are or have been in sight.
void DriveLoop::take_frame(const SensedEvent& event) {
  DriveFrame& frame = result_.frames[event.frame];
  const Transform T_world_believed =
      T_world_vehicle(world_.believed(event.vehicle)) * drive_.sensor.T_vehicle_sensor;
  LineOfSightScan scan =
      sight_.scan(frame.T_world_sensor, world_.placements(event.capture_time), T_world_believed);
  if (unseen_) {
    unseen_->see(event.capture_time - unseen_time_, world_.believed(event.vehicle));
    unseen_time_ = event.capture_time;
  }
  AnswerEvent answer{event.capture_time, time_ + delay_, {}};
  if (!scan.object_hits.empty()) {
    frame.fate = FrameFate::in_sight;
    if (!sightings_.any() && latest_) perceived_ = *latest_;
    sightings_.see(scan.objects_seen, *world_.believed_hidden(event.vehicle, event.capture_time),
                   event.capture_time, perceived_.answer);
    answer.ready = time_;
    answer.answer = sightings_.answer(perceived_.answer,
                                      std::max(0.0, event.capture_time - perceived_.capture_time),
                                      event.capture_time);
    answers_.clear();  // answers from before the object was in sight
  } else if (sightings_.any()) {
    frame.fate = FrameFate::seen_before;
  } else if (time_ < busy_until_) {
    frame.fate = FrameFate::busy;
  } else {
    SensedFrame sensed;
    if (options_.keep_pictures || perception_->needs_histograms()) {
      const StageTimer watch(frame.time_ms.sense);
      sensed = sensor_.sense(frame.T_world_sensor, world_.hidden(event.capture_time),
                             options_.seed + kFrameSeeds * (event.frame + 1));
    }
    sensed_from_ = event.vehicle;
    {
      const StageTimer watch(frame.time_ms.perceive);
      answer.answer = perception_->perceive(sensed.capture, T_world_believed, event.capture_time);
    }
    if (options_.real_time && started_) answer.ready = time_ + frame.time_ms.perceive / 1000;
    started_ = true;
    busy_until_ = answer.ready;
    if (options_.keep_pictures) {
      frame.counts = std::move(sensed.capture.counts);
      frame.object_counts = std::move(sensed.object_counts);
    }
  }
  // Objects in sight are tracked. Their track stands for the points that rays met on them, and it
  // moves on with the object.
  scan.object_hits.clear();
  update_map(&scan, nullptr);
  if (frame.fate == FrameFate::used || frame.fate == FrameFate::in_sight) {
    answers_.push_back(std::move(answer));
  }
}

void DriveLoop::take_answer(const AnswerEvent& event) {
  latest_ = event;
  if (event.answer.mixture) update_map(nullptr, &event);
}

void DriveLoop::update_map(const LineOfSightScan* scan, const AnswerEvent* event) {
  const StageTimer watch(times_.map);
  std::optional<HiddenAnswer> answer;
  if (event != nullptr) answer = split(*event).standing;
  grid_.update(time_ - map_time_, scan, answer ? &*answer : nullptr);
  map_time_ = time_;
}

/// An answer predicted to now, split into standing and moving objects. The published controller
/// knows no movers, so all objects stay on its map.
StandingAndMoving DriveLoop::split(const AnswerEvent& event) const {
  const HiddenAnswer answer{*event.answer.mixture, time_ - event.capture_time,
                            event.answer.velocities};
  return published_ ? StandingAndMoving{answer, {}}
                    : split_by_motion(map_scene_, drive_.motion, answer);
}

void DriveLoop::plan() {
  const StageTimer watch(times_.plan);
  occupancy_ = occupancy();
  const PlanningGrid planning = replanner_.planner().grid(drive_.map, within_lane());
  if (published_) return plan_as_published(planning);
  const VehicleState at = believed();
  std::vector<Mover> movers;
  if (latest_ && latest_->answer.mixture) movers = split(*latest_).moving;
  const PlanUpdate update = replanner_.update(planning, {at.position, at.yaw}, at.speed, goal(),
                                              steered_curvature(), movers);
  plan_text_ = update.text();
  held_ = false;
  follow(update);
  const TrafficDecision before = std::exchange(traffic_, {});
  if (!follower_) return;
  limit_speed(planning);
  TrafficOptions traffic = traffic_options(drive_);
  // A vehicle that brakes goes on braking until the way is clear. Otherwise it would creep up to
  // the other road user.
  if (before.braking > 0) traffic.comfortable = kGentle;
  traffic_ = decide_for_traffic(*follower_, at, body_, limits_.friction, movers, traffic);
}

/// The published controller makes a new plan with every map and never brakes.
void DriveLoop::plan_as_published(const PlanningGrid& planning) {
  const PathStatus status = published_->plan(planning, believed(), goal(), drive_.vehicle.length);
  plan_text_ = status == PathStatus::found ? "replan: published"
                                           : "keep: " + std::string(path_status_word(status));
  path_ = published_->points();
  brake_ = false;
}

/// Makes a follower for a new path. To stop, the vehicle drives the rest of the path to its end. If
/// the rest is too short, it brakes at the friction limit.
void DriveLoop::follow(const PlanUpdate& update) {
  no_way_ = update.action == PlanAction::stop;
  brake_ = no_way_ && (update.stops_too_late || update.path.points.size() < 2);
  if (update.action == PlanAction::keep && follower_) return;
  path_.clear();
  for (const PathPoint& point : update.path.points) path_.push_back(point.position);
  if (path_.size() < 2) {
    follower_.reset();
    brake_ = true;
    return;
  }
  PathFollowerOptions options = follower_options(limits_);
  options.profile.speed = speed();
  // A plan that considers friction is made for the held speed. A plan made after a stop turns
  // tighter, and the vehicle drives it accordingly.
  if (drive_.vehicle.cornering_share)
    options.profile.cornering = *drive_.vehicle.cornering_share;
  else if (!drive_.vehicle.brakes_for_curves) {
    options.profile.cornering = std::numeric_limits<double>::infinity();
  }
  options.profile.end = update.action == PlanAction::stop ? 0.0 : speed();
  follower_.emplace(update.path.points, limits_, believed(), options);
  outlook_.reset();
  unseen_limits_.clear();
}

/// Lowers the follower's speeds until the steering can follow, and until the vehicle can stop for
/// objects that may be there and for what it would touch beside its path.
void DriveLoop::limit_speed(const PlanningGrid& planning) {
  const bool safe = drive_.speed_mode == SpeedMode::safe;
  if (!drive_.vehicle.brakes_for_curves && !unseen_ && !safe) return;
  const std::vector<PathPoint>& path = follower_->path();
  const double here = nearest_arc_length(path, believed().position, path.front().arc_length,
                                         path.back().arc_length);
  std::vector<double> steerable = steerable_speeds(path, limits_, here, steered_curvature());
  if (!drive_.vehicle.brakes_for_curves) {
    std::ranges::fill(steerable, std::numeric_limits<double>::infinity());
  }
  if (unseen_) limit_for_unseen(steerable, here);
  if (!safe) return follower_->limit_speed(steerable, believed());
  if (!outlook_) {
    outlook_.emplace(path, vehicle_.model().footprint(), drive_.sensor.T_vehicle_sensor, sight_,
                     drive_.map, outlook_options(drive_, limits_, speed()));
  }
  const std::vector<PoseHypothesis> hypotheses =
      hypotheses_.of(grid_.hidden_mixture(), grid_.not_seen());
  std::vector<double> limits = safe_speed_limits(
      path, limits_, outlook_->encounters(hypotheses, here), here, safe_speed_options(drive_));
  std::ranges::transform(limits, steerable, limits.begin(),
                         [](double a, double b) { return std::min(a, b); });
  follower_->limit_speed(limits, believed());
  if (brake_) return;
  Vehicle ahead(vehicle_);
  ahead.place(believed());
  const std::optional<double> contact = predicted_contact(
      ahead, *follower_, planning, body_, prediction_options(drive_, limits_, believed().speed));
  if (!contact) return;
  held_ = true;
  stop_at(path, *contact - safe_speed_options(drive_).margin, limits);
  follower_->limit_speed(limits, believed());
}

/// Lowers speeds at the samples of the follower's path until the vehicle can stop for a road user
/// who comes from a place out of its sight.
void DriveLoop::limit_for_unseen(std::vector<double>& limits, double here) {
  if (unseen_limits_.empty() || time_ - unseen_limits_time_ >= kLooksAgain) {
    unseen_limits_ = unseen_->limits(follower_->path(), here, speed(), limits_.friction);
    unseen_limits_time_ = time_;
  }
  std::ranges::transform(limits, unseen_limits_, limits.begin(),
                         [](double a, double b) { return std::min(a, b); });
}

/// The next point of the route, or the finish line after the last point.
PathGoal DriveLoop::goal() const {
  if (next_goal_ < drive_.route.size()) return {drive_.route[next_goal_], {}, {}};
  return {drive_.finish_line->front(), {}, drive_.finish_line->back()};
}

/// Whether the vehicle's estimated position has reached the goal since the last call.
bool DriveLoop::passed_goal() {
  const Vector2d before = std::exchange(passed_from_, believed().position);
  const PathGoal next = goal();
  if (next.line_to) return next.crossing(before, passed_from_).has_value();
  return (passed_from_ - next.point).norm() <= drive_.goal_tolerance;
}

/// One control period.
void DriveLoop::step() {
  const StageTimer watch(times_.control);
  const Vector2d from = state().position;
  const VehicleState before = believed();
  DriveRequest request = safe_stop(before, limits_);
  target_speed_ = 0;
  if (published_) {
    request = published_->follow(before, speed());
    target_speed_ = speed();
  } else if (follower_) {
    const FollowerOutput output = brake_ ? follower_->stop(before) : follower_->follow(before);
    request = output.request;
    target_speed_ = output.target_speed;
    if (traffic_.braking > 0 && !brake_) {
      if (traffic_.braking >= 1) request = follower_->stop(before).request;
      request.acceleration = std::min(request.acceleration, -traffic_.braking * limits_.friction);
      target_speed_ = 0;
    }
  }
  acceleration_ = request.acceleration;
  vehicle_.step(request, kStep);
  time_ += kStep;
  const VehicleState after = state();
  result_.length += (after.position - from).norm();
  result_.top_speed = std::max(result_.top_speed, after.speed);
  result_.trace.emplace_back(after.position.x(), after.position.y(), after.yaw);
}

/// The reason why the vehicle brakes; the gravest if there are several.
std::string DriveLoop::braking_for() const {
  constexpr double kBrakes = 0.5;  // m/s^2; weaker braking is normal control
  if (published_ || acceleration_ > -kBrakes || believed().speed < kStands) return "";
  if (no_way_) return "no plan";
  if (traffic_.braking > 0) return traffic_.mover;
  if (held_) return "what it would touch beside its path";
  return drive_.speed_mode == SpeedMode::safe || unseen_ ? "what may be hidden, or a curve"
                                                         : "a curve";
}

bool DriveLoop::finished() {
  const VehicleState at = state();
  const double clearance = world_.clearance(outline(), time_);
  clearance_ = std::min(clearance_, clearance);
  result_.clearance = std::min(result_.clearance, clearance);
  result_.time = time_;
  result_.end_speed = at.speed;
  if (clearance <= 0) {
    result_.hit = world_.touched(outline(), time_);
    result_.outcome = DriveOutcome::collision;
    return true;
  }
  if (passed_goal()) {
    const std::size_t goals = drive_.route.size() + (drive_.finish_line ? 1 : 0);
    if (++next_goal_ == goals) {
      result_.outcome = DriveOutcome::reached;
      return true;
    }
  }
  const bool stands = (no_way_ || held_) && std::abs(at.speed) < kStands;
  if (!stands) standing_since_ = -1;
  if (stands && standing_since_ < 0) standing_since_ = time_;
  result_.outcome = stands && time_ - standing_since_ >= kGivesUpAfter ? DriveOutcome::stopped
                                                                       : DriveOutcome::timeout;
  return result_.outcome == DriveOutcome::stopped || time_ >= drive_.time_limit;
}

DriveResult DriveLoop::run() {
  constexpr double kRounding = 1e-9;
  result_.clearance = std::numeric_limits<double>::infinity();
  while (!finished()) {
    const auto due = static_cast<double>(result_.frames.size()) / drive_.sensor.rate;
    const bool frame_due = time_ >= due - kRounding;
    if (frame_due) capture_frame();
    bool news = frame_due;
    while (!arriving_.empty() && arriving_.front().arrival <= time_ + kRounding) {
      const SensedEvent event = arriving_.front();
      arriving_.pop_front();
      take_frame(event);
      news = true;
    }
    while (!answers_.empty() && answers_.front().ready <= time_ + kRounding) {
      const AnswerEvent event = std::move(answers_.front());
      answers_.pop_front();
      take_answer(event);
      news = true;
    }
    if (news) plan();
    step();
    DriveFrame& frame = result_.frames.back();
    frame.time_ms.map = times_.map;
    frame.time_ms.plan = times_.plan;
    frame.time_ms.control = times_.control;
    if (!news) continue;
    frame.plan_text = plan_text_;
    frame.path = path_;
    frame.target_speed = target_speed_;
    frame.braking_for = braking_for();
    frame.braking = frame.braking_for.empty() ? 0.0 : -acceleration_;
    if (latest_) {
      frame.mixture = latest_->answer.mixture;
      frame.velocities = latest_->answer.velocities;
      frame.mixture_age = frame.time - latest_->capture_time;
      frame.flags = latest_->answer.flags;
      frame.error = latest_->answer.error;
    }
    if (options_.keep_pictures || options_.keep_last_map) frame.occupancy = occupancy_;
  }
  result_.mean_speed = result_.time > 0 ? result_.length / result_.time : 0.0;
  return std::move(result_);
}

constexpr std::array kOutcomeWords{"reached", "collision", "stopped", "timeout"};
constexpr std::array kFateWords{"used", "in_sight", "seen_before", "busy", "missing"};

}  // namespace

std::optional<PoseMixture> known_later(const Drive& drive, const DriveFrame& frame, double ahead) {
  if (!frame.mixture) return std::nullopt;
  const HiddenMotion motion(drive.scene, drive.motion, OccupancyOptions{}.dwell_time);
  return motion.predicted(*frame.mixture, frame.mixture_age + ahead, frame.velocities);
}

std::string outcome_word(DriveOutcome outcome) {
  return kOutcomeWords.at(static_cast<std::size_t>(outcome));
}

const DriveFrame* last_map(const DriveResult& result) {
  const auto last = std::ranges::find_if(
      result.frames.rbegin(), result.frames.rend(), [](const DriveFrame& frame) {
        return frame.fate == FrameFate::used && frame.mixture && !frame.occupancy.empty();
      });
  return last == result.frames.rend() ? nullptr : &*last;
}

std::string fate_word(FrameFate fate) { return kFateWords.at(static_cast<std::size_t>(fate)); }

DriveResult drive_through(const Drive& drive, const SimulatedSensor& sensor,
                          const DriveOptions& options) {
  return DriveLoop(drive, sensor, options).run();
}

}  // namespace blindcorner
