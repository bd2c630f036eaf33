// SPDX-License-Identifier: Apache-2.0
/// Captures as tal keeps them (Royo et al., y-tal on PyPI): HDF5 with `H`, grids of the points that
/// sensor and laser look at, and times as optical path lengths in metres.
#pragma once

#include <string>

#include "blindcorner/io/export_file.h"

namespace blindcorner {

/// Bytes of a tal file with one of the captures. tal has the relay wall in z = 0 and y up, so that
/// (x, y, z) of the world is (x, z, -y) of the file. What captures do not hold (laser, normals) is
/// empty. Throws Error naming `path`, also when the program was built without libhdf5.
std::string tal_file(const CaptureFile& file, const ExportOptions& options,
                     const std::string& path);

}  // namespace blindcorner
