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
  double horizon = 50;         ///< m ahead of the vehicle that are examined
  double station_spacing = 1;  ///< m between the places from which sight is predicted
  /// m by which the vehicle's body is widened on each side: how far the vehicle strays from its
  /// path.
  double side_margin = 0.1;

  /// Throws Error naming the field.
  void validate() const;
};

/// Examines one path; make a new outlook when the path changes. At each station, rays are cast at
/// the known scene only once.
class PathOutlook {
 public:
  /// `sight` must outlive this object. Throws Error for a path without points and for wrong
  /// options.
  PathOutlook(std::vector<PathPoint> path, const VehicleRectangle& body,
              const Transform& T_vehicle_sensor, const LineOfSight& sight, const GridGeometry& grid,
              const PathOutlookOptions& options = {});

  /// Where the vehicle, now at arc length `from`, would touch and first see the hypotheses.
  /// Hypotheses are left out when the vehicle would not touch them within the horizon, or touches
  /// them already. A contact is rounded back to the step before (half a cell), and a sight is
  /// rounded forward to the next station, so that both err on the safe side.
  std::vector<Encounter> encounters(std::span<const PoseHypothesis> hypotheses, double from);

 private:
  struct Station {
    PathPoint place;
    std::vector<std::size_t> sees;  ///< cells; valid once `looked` is true
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
  std::vector<double> first_touched_;  ///< [cells] m, arc length of the first touch; infinity: none
};

}  // namespace blindcorner
