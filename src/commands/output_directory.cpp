// SPDX-License-Identifier: Apache-2.0
#include "commands/output_directory.h"

#include <filesystem>

#include "blindcorner/forward/error.h"

namespace blindcorner {

void make_directory(const std::string& path) {
  std::error_code code;
  std::filesystem::create_directories(path, code);
  if (code || !std::filesystem::is_directory(path)) {
    throw OutputError(path, "cannot be made a directory" + (code ? ": " + code.message() : ""));
  }
}

}  // namespace blindcorner
