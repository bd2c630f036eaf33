// SPDX-License-Identifier: Apache-2.0
/// Checks of MATLAB files beyond those of the library that reads them.
#pragma once

#include <string>

namespace blindcorner {

/// Walks through a MATLAB 5 file. Throws Error naming it when an element reaches beyond what holds
/// it, an array declares more numbers or cells than it holds, cells nest deeper than our files do,
/// packed elements are larger than a file of this size can honestly need, or a variable is neither
/// numbers nor text nor cells of these. Files of MATLAB 7.3 (HDF5) are passed over: their library
/// checks sizes itself.
void check_matlab_file(const std::string& path);

}  // namespace blindcorner
