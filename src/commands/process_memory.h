// SPDX-License-Identifier: Apache-2.0
/// How much memory this process holds (Linux).
#pragma once

namespace blindcorner {

/// MB of 1e6 bytes; 0 where the system does not say.
struct ProcessMemory {
  double resident = 0;  ///< now
  double peak = 0;      ///< most since the process began, or since reset_peak_memory()
};
ProcessMemory process_memory();

/// Gives memory that is no longer used back to the system, then counts the peak from here on.
void reset_peak_memory();

}  // namespace blindcorner
