// SPDX-License-Identifier: Apache-2.0
/// `drive.json`: what happened on a drive, for other programs. Fields are explained in
/// docs/drive.md.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "blindcorner/simulation/drive_loop.h"

namespace blindcorner {

inline constexpr const char* kDriveFormat = "blindcorner.drive/1";

/// How the drive ended and why, then since when the vehicle knew of what is hidden, for a reader
/// who knows nothing of the method.
std::string drive_headline(const Drive& drive, const DriveResult& result);

/// Numbers that are not finite become null.
nlohmann::json drive_json(const Drive& drive, const DriveOptions& options,
                          const DriveResult& result);

/// A self-contained page that plays the drive: a map with vehicle, field of view, grid, modes and
/// path, timelines, histograms, a time slider. Needs a result with pictures
/// (DriveOptions::keep_pictures).
std::string drive_page(const Drive& drive, const DriveOptions& options, const DriveResult& result);

/// What a perception is, in the words of a sentence: "with direct sight only".
std::string perception_phrase(const std::string& perception);

/// All that a page needs to play the drive beside another one (side_by_side.h); without histograms
/// and map, a few hundred kilobytes.
nlohmann::json drive_replay(const Drive& drive, const DriveOptions& options,
                            const DriveResult& result);

/// The map of that page as an animated SVG that loops (SMIL), for where no script may run.
std::string drive_animation(const Drive& drive, const DriveResult& result);

/// One drive of an animation.
struct AnimatedDrive {
  std::string caption;
  const DriveResult* result = nullptr;
};

/// Drives through the same world with one clock: beside each other where the part of the map that
/// they need is high, else one above the other.
std::string drive_animation(const Drive& drive, const std::vector<AnimatedDrive>& drives);

}  // namespace blindcorner
