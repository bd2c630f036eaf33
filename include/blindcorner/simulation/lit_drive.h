// SPDX-License-Identifier: Apache-2.0
/// Drives as commands read them.
#pragma once

#include <string>

#include "blindcorner/io/drive_file.h"

namespace blindcorner {

/// Reads a drive file; its scene has the laser's light. `light`: factor on that light in place of
/// the file's; 0: the file's. Throws Error.
Drive read_lit_drive(const std::string& path, double light);

}  // namespace blindcorner
