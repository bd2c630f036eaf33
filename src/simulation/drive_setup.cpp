// SPDX-License-Identifier: Apache-2.0
#include "simulation/drive_setup.h"

#include <algorithm>
#include <cmath>

#include "blindcorner/planner/control/path_follower.h"
#include "blindcorner/planner/vehicles/car.h"
#include "blindcorner/planner/vehicles/differential_drive.h"

namespace blindcorner {
namespace {

/// A cell this likely to be occupied is an obstacle. If an object of one cell's width has a
/// position that is uncertain by as much, no cell is above a third, but a path across all of them
/// hits the object for sure.
constexpr double kAvoidedProbability = 0.2;
/// Unknown cells are no obstacles, or no vehicle could drive around a corner, but they cost as a
/// risk.
constexpr double kUnknownOccupancy = 0.1;
/// Room that plans leave on each side for the follower's offset from the path, in vehicle widths.
constexpr double kMargin = 0.1;
/// Shares that plans use: of the friction limit in curves (unless the drive says), of this limit
/// when braking for curves, and of the steering's rate. The follower needs the rest.
constexpr double kCorneringShare = 0.7, kBrakingShare = 0.4, kSteeringShare = 0.8;
/// A metre at risk 0.1 costs as much as two.
constexpr double kRiskWeight = 10;

CurveLimits curve_limits(const DriveVehicle& vehicle, const VehicleLimits& limits, double speed) {
  CurveLimits curves;
  // A vehicle that turns on the spot does so before it drives off. On its way it turns about its
  // own side.
  curves.turning_radius = vehicle.turning_radius > 0 ? vehicle.turning_radius : vehicle.width / 2;
  const double share = vehicle.cornering_share.value_or(kCorneringShare);
  if (vehicle.cornering_share || vehicle.brakes_for_curves) {
    curves.lateral_acceleration = share * limits.friction;
  }
  if (vehicle.brakes_for_curves) curves.braking = kBrakingShare * limits.friction;
  if (limits.wheelbase > 0 && std::isfinite(limits.steering_rate)) {
    curves.curvature_speed = kSteeringShare * limits.steering_rate / limits.wheelbase;
  }
  curves.wanted_speed = speed;
  return curves;
}

}  // namespace

std::shared_ptr<const VehicleModel> model_of(const DriveVehicle& vehicle) {
  if (vehicle.kind == VehicleKind::car) {
    CarParameters parameters;
    parameters.body.length = vehicle.length;
    parameters.body.width = vehicle.width;
    parameters.friction = vehicle.friction;
    return make_car(parameters);
  }
  DifferentialDriveParameters parameters;
  parameters.length = vehicle.length;
  parameters.width = vehicle.width;
  parameters.friction = vehicle.friction;
  return make_differential_drive(parameters);
}

VehicleFootprint footprint_of(const VehicleModel& model, double margin) {
  const VehicleRectangle body = model.footprint();
  return VehicleFootprint::rectangle(body.length + 2 * margin, body.width + 2 * margin,
                                     body.center_x, body.rear_axle);
}

PathPlannerOptions planner_options(const DriveVehicle& vehicle, const VehicleModel& model,
                                   double speed) {
  PathPlannerOptions options =
      vehicle.kind == VehicleKind::car ? PathPlannerOptions::car() : PathPlannerOptions::robot();
  options.grid.occupied_threshold = kAvoidedProbability;
  options.grid.unknown_occupancy = kUnknownOccupancy;
  options.grid.risk_weight = kRiskWeight;
  options.curves = curve_limits(vehicle, model.limits(), speed);
  options.turns_on_the_spot = vehicle.turning_radius == 0;
  options.footprint = footprint_of(model, kMargin * model.footprint().width);
  options.point_spacing = std::min(options.point_spacing, vehicle.length / 4);
  return options;
}

ReplannerOptions replanner_options(const Drive& drive) {
  ReplannerOptions options;
  options.goal_tolerance = drive.goal_tolerance;
  options.max_offset = std::min(options.max_offset, drive.vehicle.width);
  options.stop_margin = std::min(options.stop_margin, drive.vehicle.length / 2);
  return options;
}

LineOfSightOptions sight_options(const Drive& drive) {
  LineOfSightOptions options;
  options.max_range = drive.sight.range;
  options.field_of_view = drive.sight.field_of_view;
  options.lowest = std::min(options.lowest, drive.vehicle.height / 4);
  options.highest = std::max(drive.vehicle.height, options.lowest);
  return options;
}

OccupancyOptions occupancy_options(const Drive& drive) {
  OccupancyOptions options;
  if (drive.speed_mode == SpeedMode::safe && drive.motion.initial_speed > 0) {
    options.moving_evidence_time = drive.vehicle.width / drive.motion.initial_speed;
  }
  return options;
}

SafeSpeedOptions safe_speed_options(const Drive& drive) {
  SafeSpeedOptions options;
  options.risk = drive.risk;
  options.closing_speed = drive.closing_speed;
  options.reaction_time = 1 / drive.sensor.rate + PathFollowerOptions{}.delay;
  if (drive.sensor.late_share > 0) options.reaction_time += drive.sensor.late_by;
  options.margin = std::min(options.margin, drive.vehicle.length / 2);
  return options;
}

OccludedSpeedOptions occluded_speed_options(const Drive& drive) {
  OccludedSpeedOptions options;
  options.speed = drive.closing_speed;
  for (const auto* velocities : {&drive.truth.velocity, &drive.truth.velocity_upper}) {
    for (const Eigen::Vector2d& v : *velocities) options.speed = std::max(options.speed, v.norm());
  }
  // The vehicle brakes for the first frame that shows somebody.
  options.reaction_time = 1 / drive.sensor.rate + PathFollowerOptions{}.delay;
  if (drive.sensor.late_share > 0) options.reaction_time += drive.sensor.late_by;
  options.margin = std::min(options.margin, drive.vehicle.width / 6);
  options.side_margin = kMargin * drive.vehicle.width / 2;
  options.station_spacing = drive.vehicle.length / 2;
  return options;
}

TrafficOptions traffic_options(const Drive& drive) {
  TrafficOptions options;
  options.risk = drive.traffic_risk;
  options.reaction_time = PathFollowerOptions{}.delay;
  options.margin = std::min(options.margin, drive.vehicle.width / 6);
  return options;
}

PathOutlookOptions outlook_options(const Drive& drive, const VehicleLimits& limits, double speed) {
  PathOutlookOptions options;
  const double braking = 0.5 * speed * speed / limits.friction;
  const SpeedProfileOptions profile;
  const SafeSpeedOptions safe = safe_speed_options(drive);
  options.horizon = braking / profile.braking + braking / safe.braking +
                    speed * safe.reaction_time + drive.vehicle.length;
  options.station_spacing = drive.vehicle.length / 5;
  options.side_margin = kMargin * drive.vehicle.width / 2;
  return options;
}

PredictionOptions prediction_options(const Drive& drive, const VehicleLimits& limits,
                                     double speed) {
  PredictionOptions options;
  const SafeSpeedOptions safe = safe_speed_options(drive);
  options.distance = safe.margin + drive.vehicle.length + std::abs(speed) * safe.reaction_time +
                     0.5 * speed * speed / (safe.braking * limits.friction);
  options.time_limit =
      std::max(options.time_limit, 2 * options.distance / std::max(1.0, std::abs(speed)));
  return options;
}

std::optional<double> obstacle_disc(const Drive& drive, const std::optional<double>& perceived) {
  constexpr double kPublished = 1;  // m (arXiv:2410.03555)
  // An object smaller than the published disc, such as a robot's sign, gets a disc of its own size.
  if (drive.controller == DriveController::published) {
    return std::min(kPublished, bounding_radius(drive.scene.hidden.shape, Anchor::center));
  }
  return perceived;
}

Scene map_scene(const Scene& scene, const std::optional<double>& disc_radius) {
  Scene known = scene;
  if (!disc_radius) return known;
  const auto as_disc = [&](HiddenObject& object) {
    // As tall as a person: only its outline matters to a map.
    object.shape = CylinderShape{*disc_radius, 1.8};
    object.anchor = Anchor::base;
  };
  as_disc(known.hidden);
  std::ranges::for_each(known.further_hidden, as_disc);
  return known;
}

}  // namespace blindcorner
