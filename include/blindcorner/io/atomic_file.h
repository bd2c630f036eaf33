// SPDX-License-Identifier: Apache-2.0
/// Files that are either written completely or not at all.
#pragma once

#include <string>
#include <string_view>

namespace blindcorner {

/// Writes `bytes` to a temporary file beside `path` and renames it over `path`, so that a reader
/// sees the old file or the new one and a failure leaves nothing behind. The directory must exist.
/// Devices and pipes, which cannot be replaced, are written to directly. Throws Error.
void write_atomically(const std::string& path, std::string_view bytes);

}  // namespace blindcorner
