// SPDX-License-Identifier: Apache-2.0
/// Makes what the parts of a drive need from the drive file. Speeds are the wanted ones, m/s.
#pragma once

#include <memory>
#include <optional>

#include "blindcorner/io/drive_file.h"
#include "blindcorner/planner/control/occluded_speed.h"
#include "blindcorner/planner/control/path_outlook.h"
#include "blindcorner/planner/control/predicted_contact.h"
#include "blindcorner/planner/control/safe_speed.h"
#include "blindcorner/planner/control/traffic.h"
#include "blindcorner/planner/grid/line_of_sight.h"
#include "blindcorner/planner/grid/occupancy_grid.h"
#include "blindcorner/planner/path/path_planner.h"
#include "blindcorner/planner/path/replanner.h"
#include "blindcorner/planner/vehicles/vehicle.h"

namespace blindcorner {

std::shared_ptr<const VehicleModel> model_of(const DriveVehicle& vehicle);

/// The vehicle's outline, wider by a margin (m) on each side.
VehicleFootprint footprint_of(const VehicleModel& model, double margin = 0);

PathPlannerOptions planner_options(const DriveVehicle& vehicle, const VehicleModel& model,
                                   double speed);
ReplannerOptions replanner_options(const Drive& drive);

LineOfSightOptions sight_options(const Drive& drive);

/// In speed mode safe, a vehicle counts on seen cells to stay free, and must not forget them while
/// it drives by. There, what was seen empty fades in the time in which hidden objects cross the
/// vehicle's width.
OccupancyOptions occupancy_options(const Drive& drive);

/// Direct sight needs no perception: it acts with the next frame.
SafeSpeedOptions safe_speed_options(const Drive& drive);

/// Unseen road users may move at most as fast as the drive file's hidden objects.
OccludedSpeedOptions occluded_speed_options(const Drive& drive);

/// Looks as far as a vehicle at the wanted speed needs to slow down and then to stop.
TrafficOptions traffic_options(const Drive& drive);

PathOutlookOptions outlook_options(const Drive& drive, const VehicleLimits& limits, double speed);

/// Looks as far as a vehicle at this speed (m/s) needs to stop.
PredictionOptions prediction_options(const Drive& drive, const VehicleLimits& limits, double speed);

/// Radius of the disc that an obstacle is on the map, m: the perception's own. With the published
/// controller it is the published one, or the bounding radius of an object smaller than that.
std::optional<double> obstacle_disc(const Drive& drive, const std::optional<double>& perceived);

/// The scene whose hidden objects the map knows: as they are, or as discs of a radius (m).
Scene map_scene(const Scene& scene, const std::optional<double>& disc_radius);

}  // namespace blindcorner
