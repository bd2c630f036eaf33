// SPDX-License-Identifier: Apache-2.0
/// Ways in which the true scene may differ from the one that methods are told.
#pragma once

#include <optional>
#include <random>
#include <string>
#include <vector>

#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

struct SceneChange {
  std::string name, description;
  std::string wrong;           ///< what the told scene says that is then wrong
  std::string left_out;        ///< why the scene cannot be changed in this way; empty: it can
  std::optional<Scene> scene;  ///< the changed one
};

/// The changes: another albedo, size and material, ten times the background, a time zero that is
/// off and a relay that is tilted.
std::vector<SceneChange> scene_changes(const Scene& scene);

/// The scene with another object of the same kind, whose unknowns follow the first one's.
SceneChange second_object_change(const Scene& scene);

/// A pose of that scene: the first object's, and one for the second that is drawn from the prior at
/// least two radii away.
PoseVector with_second_pose(const Scene& scene, const PoseVector& first, std::mt19937_64& random);

}  // namespace blindcorner
