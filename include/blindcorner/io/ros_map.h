// SPDX-License-Identifier: Apache-2.0
/// Maps in the format of ROS: an image (pgm, png or bmp) and a yaml file, by map_server's rules.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "blindcorner/planner/grid/occupancy_grid.h"

namespace blindcorner {

/// Meaning of a pixel (nav2_map_server, map_io.cpp). `occ`, 0..1, is the darkness of the pixel, or
/// with `negate` its brightness; colour channels are averaged.
enum class MapMode {
  trinary,  ///< occ > occupied_thresh: 100; occ < free_thresh: 0; else unknown. The average
            ///< includes alpha
  scale,    ///< as trinary, but 0 to 100 in proportion between the thresholds; a pixel that is not
            ///< opaque is unknown
  raw,      ///< the pixel's value itself, 0 to 100; else unknown. `negate` has no effect
};

/// Probability that a cell is occupied, in per cent, or unknown.
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
  bool negate = false;  ///< bright pixels are occupied
  double occupied_thresh = 0.65;  ///< map_saver's own
  double free_thresh = 0.196;     ///< map_saver's own: the grey of unknown cells, 205, is above it

  /// Throws Error naming the field that is out of range.
  void validate() const;
};

/// Reads a map. `image` is relative to the yaml file's folder; it is pgm (P2, P5), png or bmp, told
/// apart by the first bytes. `mode` may be absent (trinary); all other keys are required. A map
/// whose origin is turned (yaw) is resampled on cells along the axes. Each of these cells takes the
/// largest value at nine places within it, so that thin walls stay closed. Throws Error naming
/// file, field, what was found and what is accepted.
RosMap read_ros_map(const std::string& yaml_path);

/// Writes `yaml_path` and, beside it, the image with the same name and the ending ".pgm" or ".png".
/// Reading gives the same map back: every cell in the modes scale and raw; in trinary after the
/// thresholds have turned each cell into 0, 100 or unknown. Each file is written completely or not
/// at all, the yaml file last. Throws Error for a path that does not end in .yaml or .yml.
void write_ros_map(const std::string& yaml_path, const RosMap& map,
                   const RosMapOptions& options = {});

/// A grid as a map: known cells in per cent, all others unknown.
RosMap ros_map(const OccupancyGrid& grid);

/// A grid whose only evidence is the map, as static evidence. Each known cell gets the probability
/// that the map states (0 and 100 as far as the grid's bound allows).
OccupancyGrid occupancy_grid(const RosMap& map, const OccupancyOptions& options = {});

}  // namespace blindcorner
