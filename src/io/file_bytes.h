// SPDX-License-Identifier: Apache-2.0
/// Reading whole files, with errors worth showing.
#pragma once

#include <cstddef>
#include <limits>
#include <string>

namespace blindcorner {

/// Deflate cannot shrink data by more than 1032 : 1 (zlib's technical notes). A file that promises
/// more is damaged, and believing it would exhaust the memory.
inline constexpr std::size_t kDeflateExpansion = 1032;

/// Throws Error when `path` is missing, a directory, empty or not readable.
void check_readable(const std::string& path);

/// Contents of the file, at most its first `most` bytes. Throws Error as `check_readable` does.
std::string read_bytes(const std::string& path,
                       std::size_t most = std::numeric_limits<std::size_t>::max());

/// `text` on a single line: messages of other libraries may hold line breaks.
std::string one_line(std::string text);

}  // namespace blindcorner
