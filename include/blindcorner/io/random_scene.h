// SPDX-License-Identifier: Apache-2.0
/// Scenes that nobody has tuned: drawn at random, to try the fit on.
#pragma once

#include <cstdint>
#include <string>

namespace blindcorner {

/// A scene file and what goes with it.
struct RandomScene {
  std::string name;      ///< "random_SEED": of the scene, and of its files
  std::string text;      ///< of the scene file
  std::string mesh;      ///< text of NAME.obj beside it; empty: the hidden object is no mesh
  double photons = 100;  ///< of the object, on average over the search region: 10 to 10^7
};

/// A sensor (any preset) before a wall, on a table, in a yard or on nothing, a partition, and
/// behind it a box, sphere, plate, cylinder or mesh, matt or retroreflective. Lengths, directions,
/// albedos, the unknowns and the light are drawn as well. Every seed gives a scene that
/// parse_scene_text() takes and whose sensor sees a relay surface; the same on every machine.
RandomScene random_scene(std::uint64_t seed);

}  // namespace blindcorner
