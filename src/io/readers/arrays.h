// SPDX-License-Identifier: Apache-2.0
/// Captures from arrays whose order of axes somebody states.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "blindcorner/io/import_file.h"
#include "io/npy.h"
#include "io/npz.h"
#include "io/readers/capture_reader.h"

namespace blindcorner {

/// Throws Error where `axes` is no list of capture, row, column, zone and bin with a bin in it.
void check_axes(const std::string& axes);
/// The same axes, the last one first.
std::string reversed_axes(const std::string& axes);
/// Throws Error where `axes_world` is no turn of x, y and z.
void check_world_axes(const std::string& axes_world);

/// Rows and columns of `zones` zones: as the options state, or a square, which is noted. Throws
/// Error naming `where` for a number of zones that neither fits.
std::pair<int, int> zone_layout(std::size_t zones, const ImportOptions& options,
                                const std::string& where, ImportNotes& notes);

/// Captures of an array in C order, its axes as the options state them. Throws Error naming
/// `where`.
std::vector<Capture> arrange(const NpyArray& array, const ImportOptions& options,
                             const std::string& where, ImportNotes& notes);

/// An array of numbers of a .npz. Throws Error, also for one of text.
NpyArray read_numbers(const NpzFile& archive, const std::string& path, const std::string& name);

/// Puts the sensor where `positions`, [captures, 3] or [3] in metres, have it. Throws Error naming
/// `where`.
void place_sensor(std::vector<Capture>& captures, const NpyArray& positions,
                  const ImportOptions& options, const std::string& where);

}  // namespace blindcorner
