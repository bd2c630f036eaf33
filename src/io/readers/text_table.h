// SPDX-License-Identifier: Apache-2.0
/// Text tables whose columns a pattern states.
#pragma once

#include <string>

namespace blindcorner {

/// Throws Error unless `pattern` is a list of columns as in docs/capture.md.
void check_pattern(const std::string& pattern);

}  // namespace blindcorner
