// SPDX-License-Identifier: Apache-2.0
/// Random scenes that nobody has tuned, to test the fit.
#pragma once

#include <cstdint>
#include <string>

namespace blindcorner {

/// A scene file and the data that belong to it.
struct RandomScene {
  std::string name;      ///< "random_SEED": name of the scene and of its files
  std::string text;      ///< of the scene file
  std::string mesh;      ///< text of NAME.obj beside it; empty: the hidden object is no mesh
  double photons = 100;  ///< of the object, average over the search region: 10 to 10^7
};

/// A sensor (any preset) in front of a wall, on a table, in a yard or without ground, a partition,
/// and behind it a box, sphere, plate, cylinder or mesh, matt or retroreflective. Lengths,
/// directions, albedos, the unknowns and the light are also random. Every seed gives a scene that
/// parse_scene_text() accepts and whose sensor sees a relay surface. A seed gives the same scene on
/// every machine.
RandomScene random_scene(std::uint64_t seed);

}  // namespace blindcorner
