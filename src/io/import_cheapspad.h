// SPDX-License-Identifier: Apache-2.0
/// Captures of the CheapSPAD data set's MATLAB files (Callenberg et al., SIGGRAPH 2021).
#pragma once

#include <string>
#include <vector>

#include "blindcorner/io/import_file.h"

namespace blindcorner {

/// Reads `datacubes` {positions}[2, 2, bins, repeats] and `positions` {positions}[3] (m).
///
/// A relay spot (row, column) and a phase make one zone: zone 2 * spot + phase, the capture has a
/// row per spot and two columns. Repeats of a spot alternate between two phases that differ in
/// gain, ambient light and where the time axis wraps; which of them came first changes from spot to
/// spot and position to position, so phase 0 is the one whose direct return is brighter. Its time
/// axis wraps after 20 bins: bins 20 to 22 get what the file
/// has in bins 0 to 2, which is of use where no direct return lights those. The truth is x_m, y_m,
/// z_m. Repeats that were rejected are counted in `warnings` by reason, and captures carry the
/// number of repeats that were averaged in each zone. Throws Error, also when the program was built
/// without matio.
CaptureFile import_cheapspad(const std::string& path, const ImportOptions& options,
                             std::vector<std::string>& warnings);

/// Whether this build reads MATLAB files.
bool reads_matlab();

}  // namespace blindcorner
