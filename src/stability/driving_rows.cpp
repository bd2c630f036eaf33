// SPDX-License-Identifier: Apache-2.0
/// Rows about the planner, vehicles and the tracker.
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "blindcorner/inverse/tracking/tracker.h"
#include "blindcorner/planner/path/path_planner.h"
#include "blindcorner/planner/vehicles/vehicle.h"
#include "stability/cases.h"
#include "stability/themes.h"

namespace blindcorner {
namespace {

const char* const kDriving = "Vehicles and planner";
const char* const kTracking = "Tracker";
/// The default tolerance.
constexpr IntegratorTolerance kTolerance;
/// Full braking, rolling, throttle, m/s^2.
constexpr std::array kAccelerations{-9.0, 0.0, 4.0};

/// Where a car that steers is after one second at this acceleration.
Eigen::Vector2d driven(double speed, double acceleration, double steering, double step,
                       const IntegratorTolerance& tolerance = kTolerance) {
  Vehicle car(make_vehicle_model("car"), make_stiff_integrator(tolerance));
  car.place({.speed = speed});
  const int steps = static_cast<int>(std::lround(1 / step));
  for (int i = 0; i < steps; ++i) car.step(VehicleCommand{acceleration, steering}, step);
  return car.state().position;
}

StabilityMeasurement steps_agree(double speed) {
  double worst = 0;
  for (const double acceleration : kAccelerations) {
    const Eigen::Vector2d fine = driven(speed, acceleration, 0.3, 1e-3);
    const double off = (driven(speed, acceleration, 0.3, 0.1) - fine).norm();
    worst = std::isfinite(off) ? std::max(worst, off) : std::numeric_limits<double>::infinity();
  }
  return {1e3 * worst, ""};
}

StabilityRow steps_row(const std::string& name, double speed) {
  return {name,
          kDriving,
          "Car braked fully, rolling and under throttle for 1 s while it steers: difference of the "
          "place at steps of 1 and of 100 ms",
          0.1,
          "mm",
          LimitOrigin::arithmetic,
          "The integrator's tolerance is 1e-6 an inner step; 0.1 mm is a hundred of them.",
          [=] { return steps_agree(speed); }};
}

/// Largest difference of the place from the place at a tolerance of 1e-12, divided by a thousand
/// times the tolerance.
StabilityMeasurement tolerances() {
  double worst = 0;
  for (const double acceleration : kAccelerations) {
    const Eigen::Vector2d right = driven(5, acceleration, 0.3, 0.1, {1e-12, 1e-12});
    for (const double tolerance : {1e-2, 1e-4, 1e-6, 1e-8, 1e-10}) {
      const double off = (driven(5, acceleration, 0.3, 0.1, {tolerance, tolerance}) - right).norm();
      worst = std::isfinite(off) ? std::max(worst, off / (1000 * tolerance))
                                 : std::numeric_limits<double>::infinity();
    }
  }
  return {worst, ""};
}

StabilityMeasurement standing() {
  Vehicle car(make_vehicle_model("car"), make_stiff_integrator(kTolerance));
  for (int i = 0; i < 100; ++i) car.step(VehicleCommand{-9, 0.2}, 0.1);
  return {car.state().position.norm(), ""};
}

/// 0 if the planner finds a path where there is one, and refuses by its status where there is none.
StabilityMeasurement planned(const GridGeometry& geometry, double occupancy, double from, double to,
                             bool expected) {
  PathPlanner planner(PathPlannerOptions::robot());
  const std::vector<double> cells(geometry.cells(), occupancy);
  const PlanningGrid grid = planner.grid(geometry, cells);
  PathRequest request;
  request.start = Eigen::Vector2d(from, from);
  request.goal.point = Eigen::Vector2d(to, to);
  const Path path = planner.plan(grid, request);
  return {path.found() == expected ? 0.0 : 1.0, path.found() ? "found" : "none"};
}

StabilityRow plan_row(const std::string& name, const std::string& what, int cells, double cell_size,
                      double occupancy, double from, double to, bool expected) {
  GridGeometry geometry;
  geometry.columns = geometry.rows = cells;
  geometry.cell_size = cell_size;
  return {name,
          kDriving,
          what + ": 0 where the answer is right",
          0,
          "1",
          LimitOrigin::arithmetic,
          expected ? "Nothing stands in the way." : "There is no way.",
          [=] { return planned(geometry, occupancy, from, to, expected); }};
}

/// An object on a floor. The light of a frame shows its place to 5 cm, or nothing.
Scene floor_scene() {
  Scene scene;
  scene.unknowns = {{Component::x, -4, 4, std::nullopt}, {Component::y, -4, 4, std::nullopt}};
  scene.linear.amplitude = LinearMode::fixed;
  return scene;
}

class PointFrame final : public FrameLikelihood {
 public:
  explicit PointFrame(Eigen::Vector2d peak) : peak_(std::move(peak)) {}

  Update update(const Gaussian& prior, const Eigen::VectorXd& /*start*/,
                double inflation) const override {
    const Eigen::MatrixXd spread =
        prior.covariance + inflation * 0.0025 * Eigen::MatrixXd::Identity(2, 2);
    const Eigen::MatrixXd gain = prior.covariance * spread.inverse();
    const Eigen::VectorXd d = peak_ - prior.mean;
    Update result;
    result.posterior = {prior.mean + gain * d, prior.covariance - gain * prior.covariance};
    result.log_evidence = -0.5 * d.dot(spread.inverse() * d) - 0.5 * std::log(spread.determinant());
    return result;
  }
  std::vector<Eigen::VectorXd> starts() const override { return {peak_}; }
  double log_evidence_empty(double /*inflation*/) const override { return -60; }
  void describe(const Eigen::VectorXd& /*at*/, FitResult& /*result*/) const override {}

 private:
  Eigen::Vector2d peak_;
};

class EmptyFrame final : public FrameLikelihood {
 public:
  Update update(const Gaussian& prior, const Eigen::VectorXd& /*start*/,
                double /*inflation*/) const override {
    return {prior, -50, -50};
  }
  std::vector<Eigen::VectorXd> starts() const override { return {}; }
  double log_evidence_empty(double /*inflation*/) const override { return 0; }
  void describe(const Eigen::VectorXd& /*at*/, FitResult& /*result*/) const override {}
};

/// Squared distance of the place from the heaviest mode, by the mode's covariance.
double distance(const TrackPoint& point, const Eigen::Vector2d& place) {
  if (point.modes.empty()) return std::nan("");
  const Gaussian& state = point.modes.front().state;
  const Eigen::Vector2d d = state.mean.head<2>() - place;
  return d.dot(state.covariance.topLeftCorner<2, 2>().inverse() * d);
}

StabilityMeasurement stands_still() {
  Tracker tracker(floor_scene(), Motion{});
  TrackPoint point;
  for (int i = 0; i < 300; ++i)
    point = tracker.advance(0.1, std::make_shared<PointFrame>(Eigen::Vector2d(1, 2)));
  return {distance(point, {1, 2}), ""};
}

StabilityMeasurement jumps() {
  Tracker tracker(floor_scene(), Motion{});
  TrackPoint point;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector2d place = i < 50 ? Eigen::Vector2d(1, 2) : Eigen::Vector2d(-3, -1);
    point = tracker.advance(0.1, std::make_shared<PointFrame>(place));
  }
  return {distance(point, {-3, -1}), ""};
}

StabilityMeasurement vanishes() {
  Tracker tracker(floor_scene(), Motion{});
  TrackPoint point;
  for (int i = 0; i < 40; ++i)
    point = tracker.advance(0.1, std::make_shared<PointFrame>(Eigen::Vector2d(1, 2)));
  for (int i = 0; i < 10; ++i) point = tracker.advance(0.1, std::make_shared<EmptyFrame>());
  return {point.presence_probability, ""};
}

StabilityMeasurement long_gaps() {
  Tracker tracker(floor_scene(), Motion{});
  TrackPoint point;
  for (const double dt : {0.1, 1e-9, 1e4, 0.1, 1e-9}) {
    point = tracker.advance(dt, std::make_shared<PointFrame>(Eigen::Vector2d(1, 2)));
  }
  return {distance(point, {1, 2}), ""};
}

}  // namespace

std::vector<StabilityRow> driving_rows() {
  const char* const kRegion = "Chi-squared of 2; the frames show the very place.";
  return {
      steps_row("car_steps_at_0", 0),
      steps_row("car_steps_at_0.5_m_per_s", 0.5),
      steps_row("car_steps_at_12_m_per_s", 12),
      {"integrator_tolerances", kDriving,
       "Car at 5 m/s braked, rolling and under throttle for 1 s while it steers, tolerances of "
       "1e-2 "
       "to 1e-10: largest difference of the place from that of 1e-12, over 1000 tolerances",
       1, "1", LimitOrigin::arithmetic,
       "Local errors add up over some hundred inner steps; ten times that is allowed.", tolerances},
      {"braked_car_stands", kDriving, "Standing car, braked and steered for 10 s: way", 1e-3, "m",
       LimitOrigin::physics, "Brakes hold; they do not push.", standing},
      plan_row("map_of_one_cell", "Map of one free cell, start and goal in it", 1, 10, 0, 5, 5.1,
               true),
      plan_row("goal_beside_the_map", "Goal 1000 km beside the map", 20, 0.5, 0, 5, 1e6, false),
      plan_row("start_in_an_obstacle", "Map full of obstacles", 20, 0.5, 1, 2, 8, false),
      plan_row("map_unknown", "Map of which nothing is known", 20, 0.5,
               std::numeric_limits<double>::quiet_NaN(), 2, 8, true),
      plan_row("cells_of_1_km", "Cells of 1 km", 20, 1000, 0, 2000, 15000, true),
      {"target_stands_still", kTracking,
       "Target that stands for 300 frames: distance by covariance", 13.8, "1", LimitOrigin::physics,
       kRegion, stands_still},
      {"target_jumps", kTracking,
       "Target that jumps by 5 m between two frames, 1 s later: distance by covariance", 13.8, "1",
       LimitOrigin::physics, kRegion, jumps},
      {"target_vanishes", kTracking,
       "1 s after the target vanished, each frame e^50 likelier empty: probability of presence",
       0.01, "1", LimitOrigin::physics, "Ten frames without it outweigh the prior of its stay.",
       vanishes},
      {"frames_1_ns_and_3_hours_apart", kTracking,
       "Frames 1 ns and 10^4 s apart: distance by covariance", 13.8, "1", LimitOrigin::physics,
       kRegion, long_gaps},
  };
}

}  // namespace blindcorner
