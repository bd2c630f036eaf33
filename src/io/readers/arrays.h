// SPDX-License-Identifier: Apache-2.0
/// Captures from arrays whose order of axes the options state.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "blindcorner/io/import_file.h"
#include "io/npy.h"
#include "io/npz.h"
#include "io/readers/capture_reader.h"

namespace blindcorner {

/// Throws Error unless `axes` is a list of capture, row, column, zone and bin that contains bin.
void check_axes(const std::string& axes);
/// The same axes, the last one first.
std::string reversed_axes(const std::string& axes);
/// Throws Error unless `axes_world` names x, y and z in any order, with signs.
void check_world_axes(const std::string& axes_world);

/// Rows and columns of `zones` zones: as the options state, or else a square, which is noted.
/// Throws Error naming `where` for a number of zones that fits neither.
std::pair<int, int> zone_layout(std::size_t zones, const ImportOptions& options,
                                const std::string& where, ImportNotes& notes);

/// Captures of an array in C order, its axes as the options state them. Throws Error naming
/// `where`.
std::vector<Capture> arrange(const NpyArray& array, const ImportOptions& options,
                             const std::string& where, ImportNotes& notes);

/// An array of numbers of a .npz. Throws Error, also for one of text.
NpyArray read_numbers(const NpzFile& archive, const std::string& path, const std::string& name);

/// Places the sensor at `positions`, [captures, 3] or [3] in metres. Throws Error naming `where`.
void place_sensor(std::vector<Capture>& captures, const NpyArray& positions,
                  const ImportOptions& options, const std::string& where);

}  // namespace blindcorner
