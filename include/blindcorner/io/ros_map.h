// SPDX-License-Identifier: Apache-2.0
/// Maps as ROS stores them: an image (pgm, png) and a yaml file, by map_server's rules.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "blindcorner/planner/grid/occupancy_grid.h"

namespace blindcorner {

/// What a pixel means (nav2_map_server, map_io.cpp). `occ` is how dark the pixel is, 0..1, or with
/// `negate` how bright; colour channels are averaged.
enum class MapMode {
  trinary,  ///< occ > occupied_thresh: 100; occ < free_thresh: 0; else unknown. Alpha is averaged
            ///< in
  scale,    ///< as trinary, between the thresholds 0 to 100 in proportion; not opaque: unknown
  raw,      ///< the pixel's value itself, 0 to 100; else unknown. `negate` has no effect
};

/// Per cent of probability that a cell is occupied, or nothing known of it.
struct RosMap {
  static constexpr std::int8_t kUnknown = -1, kFree = 0, kOccupied = 100;

  GridGeometry geometry;
  std::vector<std::int8_t> cells;  ///< [cells] -1, or 0 to 100

  std::int8_t at(const Cell& cell) const { return cells[geometry.index(cell)]; }
};

/// How a map is written.
struct RosMapOptions {
  MapMode mode = MapMode::trinary;
  bool png = false;     ///< as png; else as pgm, except in mode scale, which needs transparency
  bool negate = false;  ///< bright is occupied
  double occupied_thresh = 0.65;  ///< map_saver's own
  double free_thresh = 0.196;     ///< map_saver's own: the grey of unknown cells, 205, is above it

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Reads a map. `image` is relative to the yaml file's folder; pgm (P2, P5) or png, told apart by
/// their first bytes. `mode` may be absent (trinary), all other keys are required. Throws Error
/// naming file, field, what was found and what is accepted; a map whose origin is turned (yaw) is
/// refused.
RosMap read_ros_map(const std::string& yaml_path);

/// Writes `yaml_path` and the image beside it, of the same name with the ending ".pgm" or ".png".
/// What was written loads back the same: in the modes scale and raw every cell, in trinary after
/// each has become 0, 100 or unknown by the thresholds. Each file is written completely or not at
/// all, the yaml file last. Throws Error for a path that does not end in .yaml or .yml.
void write_ros_map(const std::string& yaml_path, const RosMap& map,
                   const RosMapOptions& options = {});

/// A grid as a map: known cells in per cent, the others unknown.
RosMap ros_map(const OccupancyGrid& grid);

/// A map as static evidence of a grid that knows nothing yet, to which each known cell gives the
/// probability that the map states (0 and 100 as far as the grid's bound allows).
OccupancyGrid occupancy_grid(const RosMap& map, const OccupancyOptions& options = {});

}  // namespace blindcorner
