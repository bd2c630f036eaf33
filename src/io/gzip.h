// SPDX-License-Identifier: Apache-2.0
/// Unpacking gzip files (RFC 1952) by zlib.
#pragma once

#include <limits>
#include <string>
#include <string_view>

namespace blindcorner {

/// Whether bytes begin as a gzip file does.
bool is_gzip(std::string_view bytes);

struct Unpacked {
  std::string bytes;
  bool cut = false;  ///< the file ends before its content does
};

/// Content of a gzip file of any number of members, at most its first `most` bytes. A file that was
/// cut gives the content that is there. Throws Error naming `path` for damage.
Unpacked gunzip(std::string_view packed, const std::string& path,
                std::size_t most = std::numeric_limits<std::size_t>::max());

}  // namespace blindcorner
