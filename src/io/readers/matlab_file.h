// SPDX-License-Identifier: Apache-2.0
/// Arrays of MATLAB files, versions 5 and 7.3, by matio. Builds without it throw Error that says
/// so.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "io/readers/capture_reader.h"

namespace blindcorner {

/// Real, finite numbers of one array, first index fastest.
struct MatlabArray {
  std::vector<std::size_t> shape;
  std::vector<double> values;

  std::string shape_text() const;  ///< "2 x 2 x 24 x 100"
};

/// Whether this build reads MATLAB files.
bool reads_matlab();
/// Whether a file is a MATLAB file, by its first words or its ending.
bool is_matlab(const ImportSource& source);

/// Names of the variables. Throws Error naming `path`.
std::vector<std::string> matlab_names(const std::string& path);
/// A variable of numbers. Throws Error naming `path`.
MatlabArray read_matlab_array(const std::string& path, const std::string& name);
/// Arrays of a variable of cells. Throws Error naming `path` and the cell.
std::vector<MatlabArray> read_matlab_cells(const std::string& path, const std::string& name);

}  // namespace blindcorner
