// SPDX-License-Identifier: Apache-2.0
#include "io/file_bytes.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

std::ifstream open_for_reading(const std::string& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found) throw Error(path, "no such file");
  if (error) throw Error(path, "cannot be read: " + error.message());
  if (std::filesystem::is_directory(status)) throw Error(path, "is a directory, not a file");
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw Error(path, std::string("cannot be read: ") + std::strerror(errno));
  if (stream.peek() == std::ifstream::traits_type::eof()) {
    if (stream.bad()) throw Error(path, std::string("cannot be read: ") + std::strerror(errno));
    throw Error(path, "is empty");
  }
  return stream;
}

}  // namespace

void check_readable(const std::string& path) { open_for_reading(path); }

std::string read_bytes(const std::string& path, std::size_t most) {
  std::ifstream stream = open_for_reading(path);
  std::string bytes;
  std::array<char, 1 << 16> block{};
  do {
    stream.read(block.data(), block.size());
    bytes.append(block.data(), static_cast<std::size_t>(stream.gcount()));
  } while (stream && bytes.size() < most);
  if (stream.bad()) throw Error(path, "cannot be read to its end");
  bytes.resize(std::min(bytes.size(), most));
  return bytes;
}

std::string one_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

}  // namespace blindcorner
