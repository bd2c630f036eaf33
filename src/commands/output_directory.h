// SPDX-License-Identifier: Apache-2.0
/// Directories that commands write to.
#pragma once

#include <string>

namespace blindcorner {

/// Makes a directory, and those above it, unless it is there. Throws Error naming it.
void make_directory(const std::string& path);

}  // namespace blindcorner
