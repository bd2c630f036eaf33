// SPDX-License-Identifier: Apache-2.0
/// Speeds from which a vehicle can stop before whoever may come from where it does not see.
///
/// Somebody may be in every cell that is not seen, and may move at up to u in any direction around
/// known walls. Let e(c) be the earliest time from now on at which somebody may be in cell c. Where
/// direct sight has just seen nobody, e is the way from the nearest place that is not seen over u;
/// in a cell that is not seen any more it runs down with time, from what it was. (Set-based
/// prediction of occluded traffic: Orzechowski, Meyer and Lauer 2018, "Tackling occlusions &
/// limited sensor range with set-based safety verification".) At a place of its path the vehicle
/// may drive at a speed from which, after the reaction time and with full braking, its front comes
/// to no cell c at a time at which e(c) has passed, until it stands. What it will see from places
/// ahead is known from the map, and so are its speeds there; the speed profile slows down for them
/// in time. The vehicle looks all round: it is walls that hide. Who comes from behind the sensor,
/// or against the vehicle's side, is not expected: that is not avoided by driving slowly.
#pragma once

#include <optional>
#include <vector>

#include "blindcorner/planner/control/path_follower.h"
#include "blindcorner/planner/grid/line_of_sight.h"

namespace blindcorner {

struct OccludedSpeedOptions {
  double speed = 0;             ///< u, m/s; 0: nobody who is not seen moves
  double reaction_time = 0.25;  ///< s, from the moment in which somebody shows to braking
  double margin = 0.3;          ///< m, kept before the front
  double side_margin = 0.1;     ///< m, kept on each side
  double station_spacing = 2;   ///< m, between the places at which speeds are found

  /// Throws Error naming the field.
  void validate() const;
};

class OccludedSpeed {
 public:
  /// `sight` is all round and must outlive it. `walls`: cells that nobody passes. Nothing is seen
  /// at first.
  OccludedSpeed(const LineOfSight& sight, const GridGeometry& grid, const std::vector<Cell>& walls,
                const VehicleRectangle& body, const Transform& T_vehicle_sensor,
                const OccludedSpeedOptions& options = {});

  /// `dt` seconds after the last time the vehicle looks around at `state`.
  void see(double dt, const VehicleState& state);

  /// Largest speeds at the samples of a path, m/s, up to `wanted`, for a vehicle at arc length
  /// `from`; infinite behind it and farther ahead than it looks.
  std::vector<double> limits(const std::vector<PathPoint>& path, double from, double wanted,
                             double friction) const;

  /// [cells] e, s, as far as it is looked at.
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
