// SPDX-License-Identifier: Apache-2.0
/// Scene files: JSON, documented field by field in docs/scene.md.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "blindcorner/forward/scene/motion.h"
#include "blindcorner/forward/scene/scene.h"

namespace blindcorner {

/// Reads a scene file. Throws Error with one line for each problem (at most 100): file, field path,
/// found value, accepted values. Unknown fields are errors.
Scene read_scene(const std::string& path);

/// The same with a calibration's results applied: the `patch` of an instrument file
/// (docs/instrument.md), a JSON merge patch (RFC 7386). An empty `instrument` means no patch.
Scene read_scene(const std::string& path, const std::string& instrument);

/// The same from JSON in memory; messages name `path`, and relative file names start from it.
Scene parse_scene(const nlohmann::json& json, const std::string& path);

/// The same from the text of a scene file; the unknowns keep their order.
Scene parse_scene_text(const std::string& text, const std::string& path);

/// The text of a scene file with the patch of an instrument file applied (empty: none), as
/// `read_scene` uses it. Throws Error.
std::string scene_text(const std::string& path, const std::string& instrument = {});

/// How the hidden object may move: the field `motion` of a scene file, for a tracker.
Motion read_motion(const std::string& path);
Motion parse_motion_text(const std::string& text, const std::string& path);

}  // namespace blindcorner
