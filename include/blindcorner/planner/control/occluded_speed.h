// SPDX-License-Identifier: Apache-2.0
/// Speeds from which a vehicle can stop before anybody who comes out of a hidden place.
///
/// Somebody may be in every cell that is not seen, and may move at up to u in any direction around
/// known walls. Let e(c) be the earliest time from now at which somebody may be in cell c. In a
/// cell that direct sight has just found empty, e is the distance from the nearest unseen place
/// divided by u. In a cell that is no longer seen, e counts down with time from its last value.
/// (Set-based prediction of occluded traffic: Orzechowski, Meyer and Lauer 2018, "Tackling
/// occlusions & limited sensor range with set-based safety verification".) At each place of its
/// path the vehicle may drive at a speed from which it can stop, with full braking after the
/// reaction time, while its front enters no cell c after e(c). The map tells what the vehicle will
/// see from places ahead, and so it tells the allowed speeds there; the speed profile slows the
/// vehicle down for them in time. The vehicle looks all round: only walls hide cells. People who
/// come from behind the sensor or against the vehicle's side are not considered: slow driving does
/// not avoid them.
#pragma once

#include <optional>
#include <vector>

#include "blindcorner/planner/control/path_follower.h"
#include "blindcorner/planner/grid/line_of_sight.h"

namespace blindcorner {

struct OccludedSpeedOptions {
  double speed = 0;             ///< u, m/s; 0: people who are not seen stand still
  double reaction_time = 0.25;  ///< s, from the moment somebody becomes visible to braking
  double margin = 0.3;          ///< m, kept free ahead of the front
  double side_margin = 0.1;     ///< m, kept free on each side
  double station_spacing = 2;   ///< m, between the places at which speeds are computed

  /// Throws Error naming the field.
  void validate() const;
};

class OccludedSpeed {
 public:
  /// `sight` looks all round and must outlive this object. `walls`: cells that nobody can pass. At
  /// first no cell has been seen.
  OccludedSpeed(const LineOfSight& sight, const GridGeometry& grid, const std::vector<Cell>& walls,
                const VehicleRectangle& body, const Transform& T_vehicle_sensor,
                const OccludedSpeedOptions& options = {});

  /// The vehicle looks around at `state`, `dt` seconds after it last did.
  void see(double dt, const VehicleState& state);

  /// Largest speeds at the samples of a path, m/s, at most `wanted`, for a vehicle at arc length
  /// `from`. They are infinite behind the vehicle and beyond the distance that is examined.
  std::vector<double> limits(const std::vector<PathPoint>& path, double from, double wanted,
                             double friction) const;

  /// [cells] e, s; infinite beyond the time that is examined.
  const std::vector<float>& earliest() const { return earliest_; }

 private:
  void advance(std::vector<float>& earliest, double dt, const VehicleState& state) const;
  void spread(std::vector<float>& earliest, const std::vector<bool>& open,
              const std::vector<std::size_t>& sources) const;
  float at_front(const std::vector<float>& earliest, const PathPoint& place) const;
  double largest_speed(const std::vector<float>& at_fronts, double wanted, double friction) const;

  const LineOfSight& sight_;
  GridGeometry grid_;
  VehicleRectangle body_;
  Transform T_vehicle_sensor_;
  OccludedSpeedOptions options_;
  std::vector<bool> wall_;
  std::vector<float> earliest_;
};

}  // namespace blindcorner
