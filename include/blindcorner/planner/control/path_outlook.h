// SPDX-License-Identifier: Apache-2.0
/// What a vehicle will touch and what it will see along a path.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "blindcorner/planner/control/safe_speed.h"
#include "blindcorner/planner/grid/line_of_sight.h"
#include "blindcorner/planner/grid/pose_hypotheses.h"

namespace blindcorner {

struct PathOutlookOptions {
  double horizon = 50;         ///< m ahead of the vehicle that are looked at
  double station_spacing = 1;  ///< m between the places from which sight is predicted
  /// m that the vehicle's body is widened by on each side: how far it strays from its path.
  double side_margin = 0.1;

  /// Throws Error naming the field.
  void validate() const;
};

/// For one path; make a new one when the path changes. Sight is cast at the known scene once for a
/// place.
class PathOutlook {
 public:
  /// `sight` must outlive it. Throws Error for a path without points and options that are wrong.
  PathOutlook(std::vector<PathPoint> path, const VehicleRectangle& body,
              const Transform& T_vehicle_sensor, const LineOfSight& sight, const GridGeometry& grid,
              const PathOutlookOptions& options = {});

  /// Where the vehicle, now at arc length `from`, would touch and first see the hypotheses. Those
  /// that it does not touch are left out, and those that it would touch where it is. Contacts are
  /// rounded backwards and sights forwards to the next station, so that both err to the safe side.
  std::vector<Encounter> encounters(std::span<const PoseHypothesis> hypotheses, double from);

 private:
  struct Station {
    PathPoint place;
    std::vector<std::size_t> sees;  ///< cells, once `looked`
    bool looked = false;
  };

  void find_touched(const VehicleRectangle& body, double side_margin);
  const std::vector<std::size_t>& seen_from(Station& station);

  std::vector<PathPoint> path_;
  double rear_axle_;  ///< m, of the body
  Transform T_vehicle_sensor_;
  const LineOfSight& sight_;
  GridGeometry grid_;
  PathOutlookOptions options_;
  std::vector<Station> stations_;
  std::vector<double> first_touched_;  ///< [cells] m, the vehicle comes so far; infinity: untouched
};

}  // namespace blindcorner
