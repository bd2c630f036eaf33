// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/simulation/lit_drive.h"

#include "blindcorner/simulation/perception.h"
#include "blindcorner/simulation/simulated_sensor.h"

namespace blindcorner {

Drive read_lit_drive(const std::string& path, double light) {
  Drive drive = read_drive(path);
  check_perception(drive.perception, path + ": perception.use");
  for (const auto& [name, delay] : drive.delay) {
    check_perception(name, path + ": perception.delay_s");
  }
  if (light > 0) drive.sensor.light = light;
  drive.scene = with_light(drive.scene, drive.sensor.light, drive.sensor.ambient);
  return drive;
}

}  // namespace blindcorner
