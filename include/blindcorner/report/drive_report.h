// SPDX-License-Identifier: Apache-2.0
/// `drive.json`: the course of a drive, for other programs. docs/drive.md explains the fields.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "blindcorner/simulation/drive_loop.h"

namespace blindcorner {

inline constexpr const char* kDriveFormat = "blindcorner.drive/1";

/// How the drive ended and why, and since when the vehicle knew of the hidden object, for a reader
/// who knows nothing of the method.
std::string drive_headline(const Drive& drive, const DriveResult& result);

/// The JSON of `drive.json`. Numbers that are not finite become null.
nlohmann::json drive_json(const Drive& drive, const DriveOptions& options,
                          const DriveResult& result);

/// A self-contained page that plays the drive: a map with vehicle, field of view, grid, modes and
/// path, timelines, histograms, and a time slider. Needs a result with pictures
/// (DriveOptions::keep_pictures).
std::string drive_page(const Drive& drive, const DriveOptions& options, const DriveResult& result);

/// A perception as part of a sentence: "with direct sight only".
std::string perception_phrase(const std::string& perception);

/// Everything that a page needs to play the drive beside another one (side_by_side.h). It has no
/// histograms and no grid, and takes a few hundred kilobytes.
nlohmann::json drive_replay(const Drive& drive, const DriveOptions& options,
                            const DriveResult& result);

/// The map of the drive's page as an animated SVG that loops (SMIL), for places where no script may
/// run.
std::string drive_animation(const Drive& drive, const DriveResult& result);

/// One drive of an animation.
struct AnimatedDrive {
  std::string caption;
  const DriveResult* result = nullptr;
};

/// Drives through the same world with one clock. They are side by side if the part of the map that
/// they need is high, otherwise one above the other.
std::string drive_animation(const Drive& drive, const std::vector<AnimatedDrive>& drives);

}  // namespace blindcorner
