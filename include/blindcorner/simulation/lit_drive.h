// SPDX-License-Identifier: Apache-2.0
/// Drive files as the commands read them.
#pragma once

#include <string>

#include "blindcorner/io/drive_file.h"

namespace blindcorner {

/// Reads a drive file. Its scene gets the laser light and the ambient light of the drive. `light`:
/// factor on the laser light in place of the file's factor; 0: the file's factor. Throws Error.
Drive read_lit_drive(const std::string& path, double light);

}  // namespace blindcorner
