// SPDX-License-Identifier: Apache-2.0
/// Files that are written either completely or not at all.
#pragma once

#include <string>
#include <string_view>

namespace blindcorner {

/// Writes `bytes` to a temporary file beside `path` and renames it to `path`. So a reader sees
/// either the old file or the new one, and a failure leaves nothing behind. The directory must
/// exist. Devices and pipes cannot be replaced, so they are written to directly. Throws Error.
void write_atomically(const std::string& path, std::string_view bytes);

}  // namespace blindcorner
