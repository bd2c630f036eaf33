// SPDX-License-Identifier: Apache-2.0
/// The scenes and drives that come with the program.
#pragma once

#include <map>
#include <string>

#include "blindcorner/io/drive_file.h"
#include "blindcorner/io/scene_file.h"

namespace blindcorner {

/// scenes/`name`.json
inline Scene bundled_scene(const std::string& name) {
  return read_scene(std::string(SOURCE_DIR) + "/scenes/" + name + ".json");
}

/// scenes/`name`_drive.json, which is read once; the reference stays valid.
inline const Drive& bundled_drive(const std::string& name) {
  static std::map<std::string, Drive> drives;
  const auto found = drives.find(name);
  if (found != drives.end()) return found->second;
  return drives
      .emplace(name, read_drive(std::string(SOURCE_DIR) + "/scenes/" + name + "_drive.json"))
      .first->second;
}

}  // namespace blindcorner
