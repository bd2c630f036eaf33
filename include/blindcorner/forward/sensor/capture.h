// SPDX-License-Identifier: Apache-2.0
/// Measured or rendered histograms.
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/pose.h"

namespace blindcorner {

/// Histogram cube [row][column][bin]; the bin index changes fastest. Counts of averaged captures
/// need not be whole numbers.
struct HistogramCube {
  int rows = 0, columns = 0, bins = 0;
  std::vector<double> values;

  HistogramCube() = default;
  HistogramCube(int rows_, int columns_, int bins_)
      : rows(rows_),
        columns(columns_),
        bins(bins_),
        values(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_) *
               static_cast<std::size_t>(bins_)) {}

  int zones() const { return rows * columns; }
  double* zone(int z) { return values.data() + static_cast<std::ptrdiff_t>(z) * bins; }
  const double* zone(int z) const { return values.data() + static_cast<std::ptrdiff_t>(z) * bins; }
};

/// One capture: its counts, and what is known about how they were taken.
struct Capture {
  HistogramCube counts;
  double exposures = 1.0;  ///< number of exposures that were averaged
  /// [zones] number of averaged exposures, where it differs between zones; 0: the zone has no data.
  std::optional<std::vector<double>> zone_exposures;
  std::optional<double> dispersion;         ///< variance / mean; the sensor's value if not given
  std::optional<Transform> T_world_sensor;  ///< replaces the scene's sensor pose
  std::optional<std::vector<Eigen::Vector3d>> relay_points;  ///< [zones], m, world
  std::map<std::string, double> truth;  ///< known values of unknowns: "x_m", "yaw_rad", ...
  std::string source;                   ///< file that the capture came from
  int index = 0;                        ///< position in that file

  /// Number of exposures that were averaged in one zone.
  double exposures_of(int zone) const {
    return zone_exposures ? (*zone_exposures)[static_cast<std::size_t>(zone)] : exposures;
  }
};

}  // namespace blindcorner
