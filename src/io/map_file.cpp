// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/map_file.h"

#include <algorithm>
#include <filesystem>
#include <limits>

#include "blindcorner/forward/error.h"
#include "blindcorner/io/movingai.h"
#include "blindcorner/io/ros_map.h"

namespace blindcorner {

OccupancyMap read_map(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension();
  if (extension == ".map") {
    const MovingAiMap map = read_movingai_map(path);
    return {map.geometry, map.occupancy()};
  }
  if (extension == ".yaml" || extension == ".yml") {
    const RosMap map = read_ros_map(path);
    OccupancyMap read{map.geometry, std::vector<double>(map.cells.size())};
    std::ranges::transform(map.cells, read.occupancy.begin(), [](std::int8_t per_cent) {
      return per_cent == RosMap::kUnknown ? std::numeric_limits<double>::quiet_NaN()
                                          : 0.01 * per_cent;
    });
    return read;
  }
  throw Error(path,
              "found the ending \"" + extension + "\", accepted: .yaml (ROS map), .map (MovingAI)");
}

}  // namespace blindcorner
