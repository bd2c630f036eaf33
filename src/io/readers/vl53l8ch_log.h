// SPDX-License-Identifier: Apache-2.0
/// Serial log of VL53L8CH firmware that prints its histograms as text.
#pragma once

#include <string>
#include <vector>

#include "blindcorner/io/import_file.h"

namespace blindcorner {

/// Whether a text has frames of such a log: a line `D` followed by a line of numbers.
bool is_vl53l8ch_log(const std::string& text);

/// Captures of the log `text`. A frame is a line `D` and one line per zone, row by row:
/// `<zone> <1000 x ambient> <distance mm> <1000 x bin 0> <1000 x bin 1> ...`, whole numbers. Counts
/// are the bins divided by 1000, ambient light included if the firmware leaves it in. A frame with
/// a damaged, missing or repeated line is left out, and `warnings` says so. Throws Error if there
/// is no whole frame; `path` names the log in messages.
std::vector<Capture> parse_vl53l8ch_log(const std::string& text, const std::string& path,
                                        const ImportOptions& options,
                                        std::vector<std::string>& warnings);

}  // namespace blindcorner
