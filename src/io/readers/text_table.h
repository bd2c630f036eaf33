// SPDX-License-Identifier: Apache-2.0
/// Any text table whose columns somebody states.
#pragma once

#include <string>

namespace blindcorner {

/// Throws Error where `pattern` is no list of columns, as docs/capture.md has it.
void check_pattern(const std::string& pattern);

}  // namespace blindcorner
